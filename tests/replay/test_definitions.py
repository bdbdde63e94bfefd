from __future__ import annotations

import sys
from typing import Literal

import pytest
from rosbags.typesys import get_types_from_msg

from replay.codec import ros1_typestore, ros2_typestore
from replay.sources.base import GRID_TYPE, TF_TYPE, UPDATE_TYPE
from replay.sources.definitions.difference import _type_name, differing_field
from replay.sources.definitions.text import stated_fields

LINE = "=" * 80


def _standard(msgtype: str, ros: Literal[1, 2]) -> str:
    store = ros1_typestore() if ros == 1 else ros2_typestore()
    return store.generate_msgdef(msgtype, ros_version=ros)[0]


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("msgtype", [GRID_TYPE, UPDATE_TYPE, TF_TYPE])
def test_the_standard_does_not_differ_from_itself(msgtype: str, ros: Literal[1, 2]) -> None:
    definition = _standard(msgtype, ros)
    assert differing_field(msgtype, definition, ros) is None
    other: Literal[1, 2] = 2 if ros == 1 else 1
    assert "std_msgs/msg/Header" in str(differing_field(msgtype, definition, other))


def test_the_transforms_of_old_nodes_are_the_same_type() -> None:
    assert differing_field("tf/msg/tfMessage", _standard(TF_TYPE, 1), 1) is None
    assert "transform" in str(differing_field("tf/msg/tfMessage", "geometry_msgs/TransformStamped transforms", 1))


def test_what_is_not_in_the_bytes_does_not_matter() -> None:
    head, *rest = _standard(GRID_TYPE, 2).split(LINE + "\n")
    text = (LINE + " \n").join(
        ["# a map\n\nint8 UNKNOWN=-1\n" + head.replace("data", "data # row by row"), *rest[::-1]]
    )
    assert differing_field(GRID_TYPE, text, 2) is None
    assert differing_field(GRID_TYPE, text.replace("\n", "\r\n"), 2) is None
    assert differing_field(GRID_TYPE, text.replace("int8[]", "int8[<=1000]"), 2) is None
    assert differing_field(GRID_TYPE, head, 2) is None


@pytest.mark.parametrize("text", ["", "\n", "\0", " \r\n"])
def test_nothing_is_taken_as_the_standard(text: str) -> None:
    assert differing_field(GRID_TYPE, text, 2) is None


def test_other_types_have_nothing_to_differ_from() -> None:
    assert differing_field("my_msgs/msg/Odd", "int32 x", 2) is None


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("float32 resolution", "float64 resolution", "resolution of nav_msgs/msg/MapMetaData is float64 in the rec"),
        ("int8[] data", "uint8[] data", "data of nav_msgs/msg/OccupancyGrid is uint8[] in the rec"),
        ("int8[] data", "int8[4] data", "data of nav_msgs/msg/OccupancyGrid is int8[4] in the rec"),
        ("int8[] data", "int8[] cells", "a field of nav_msgs/msg/OccupancyGrid is cells in the rec"),
        ("uint32 width\nuint32 height", "uint32 height\nuint32 width", "is height in the recording, width in the stan"),
        ("int8[] data\n", "int8[] data\nint8 kind\n", "has the field kind in the recording"),
        ("int8[] data\n", "", "has no field data"),
        ("geometry_msgs/Pose origin", "geometry_msgs/Point origin", "origin of nav_msgs/msg/MapMetaData is"),
        ("float64 w", "float32 w", "w of geometry_msgs/msg/Quaternion is float32"),
        ("nav_msgs/MapMetaData info", "my_msgs/MapMetaData info", "is my_msgs/msg/MapMetaData in the rec"),
    ],
)
def test_what_differs_is_named(before: str, after: str, expected: str) -> None:
    definition = _standard(GRID_TYPE, 2)
    assert before in definition
    assert expected in str(differing_field(GRID_TYPE, definition.replace(before, after), 2))


def test_what_is_no_definition_is_not_taken_for_one() -> None:
    for text in ("{", "int8 data", "module x {", f"{LINE}\nIDL: a/msg/B\nmodule a {{", "x" * 1_000_000):
        assert differing_field(GRID_TYPE, text, 2) is not None


IDL = f"""\
{LINE}
IDL: map_msgs/msg/OccupancyGridUpdate
// generated
#include "std_msgs/msg/Header.idl"

module map_msgs {{
  module msg {{
    struct OccupancyGridUpdate {{
      std_msgs::msg::Header header;
      int32 x;
      int32 y;
      uint32 width;
      uint32 height;
      sequence<int8> data;
    }};
  }};
}};
{LINE}
IDL: std_msgs/msg/Header
module std_msgs {{
  module msg {{
    struct Header {{
      builtin_interfaces::msg::Time stamp;
      string frame_id;
    }};
  }};
}};
"""


def test_definitions_in_idl() -> None:
    assert differing_field(UPDATE_TYPE, IDL, 2) is None
    assert differing_field(UPDATE_TYPE, IDL.partition("IDL: std_msgs")[0].split("Update\n", 1)[1], 2) is None
    assert "width" in str(differing_field(UPDATE_TYPE, IDL.replace("uint32 width", "uint16 width"), 2))
    assert "stamp" in str(differing_field(UPDATE_TYPE, IDL.replace("Time stamp", "Duration stamp"), 2))


@pytest.mark.parametrize("ros", [1, 2])
def test_fields_are_those_that_the_reference_finds(ros: Literal[1, 2]) -> None:
    store = ros1_typestore() if ros == 1 else ros2_typestore()
    names = sorted(set(store.fielddefs) - {"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"})
    assert len(names) > 100
    for name in names:
        definition = store.generate_msgdef(name, ros_version=ros)[0]
        head, *parts = definition.split(LINE + "\n")
        # of a constant alone, and of two ways to write what is not in the bytes
        text = LINE.join([f"# {name}\n{head}", *(f"\n{part}" for part in parts)])
        expected = {key: fields for key, (_, fields) in get_types_from_msg(definition, name).items()}
        assert stated_fields(name, text) == {
            key: [(field, _type_name(kind)) for field, kind in fields] for key, fields in expected.items()
        }


ODD_IDL = """\
#include "x.idl"
/* module nothing { */ // struct nothing
module a { module msg {
  @verbatim (language="comment", text="a ) \\" ; }" "b")
  module C_Constants { const long X = (1 + (2)); const string S = "};"; };
  enum Kind { ONE, TWO };
  typedef double double__9[9];
  typedef sequence<octet, 4> bytes;
  struct Inner { long long x, y; };
  @final struct C {
    @key @default (value=(3)) unsigned short u;
    double__9 covariance;
    bytes data; Inner inner; a::msg::Inner other;
    sequence<string<3>, C_Constants::X> names; boolean is_on; wstring w; std_msgs::msg::Header header; int8 z[3];
  };
}; };
"""


def test_fields_of_idl_are_found_whatever_is_beside_them() -> None:
    assert stated_fields("a/msg/C", ODD_IDL) == {
        "a/msg/Inner": [("x", "int64"), ("y", "int64")],
        "a/msg/C": [
            ("u", "uint16"),
            ("covariance", "float64[9]"),
            ("data", "byte[]"),
            ("inner", "a/msg/Inner"),
            ("other", "a/msg/Inner"),
            ("names", "string[]"),
            ("is_on", "bool"),
            ("w", "wstring"),
            ("header", "std_msgs/msg/Header"),
            ("z", "int8[3]"),
        ],
    }


def test_what_idl_allows_and_bytes_do_not_show_does_not_matter() -> None:
    text = IDL.replace(
        "struct OccupancyGridUpdate {",
        """module OccupancyGridUpdate_Constants {
      @verbatim (language="comment", text=
        "a \\"map\\" (of }; cells)" "and more")
      const long ODD = ((1 << 3) + (2));
    };
    /* struct Odd { */
    typedef sequence<int8, 1000> Cells;
    typedef std_msgs::msg::Header Head;
    @topic
    struct OccupancyGridUpdate {""",
    )
    text = text.replace("std_msgs::msg::Header header;", "@default (value=(1)) Head header;")
    text = text.replace("int32 x;\n      int32 y;", "long x, y;").replace("uint32 width", "unsigned long width")
    text = text.replace("sequence<int8> data", "msg::Cells data").replace("string frame_id", "string<40> frame_id")
    assert "typedef" in text
    assert differing_field(UPDATE_TYPE, text, 2) is None
    assert "data" in str(differing_field(UPDATE_TYPE, text.replace("sequence<int8, 1000>", "int8"), 2))
    array = text.replace("typedef sequence<int8, 1000> Cells", "typedef int8 Cells[4]")
    assert "is int8[4] in the rec" in str(differing_field(UPDATE_TYPE, array, 2))


def module(content: str) -> str:
    return f"module nav_msgs {{ module msg {{ {content} }}; }};"


NESTED = "(" * 100_000
TEXTS = {
    "parentheses": f"module a {{ const long X = {NESTED}1{NESTED.replace('(', ')')}; }};",
    "annotation": f"module a {{ @b{NESTED}",
    "sequences": "module a { struct b { " + "sequence<" * 20_000,
    "modules": "module a {\n" * 20_000,
    "comments": "module a {" + "/*" * 100_000,
    "texts": "module a {" + "'\"" * 100_000,
    "newlines": "\n" * 200_000 + "int8 x",
    "spaces": "int8 " + " " * 200_000 + "-",
    "separators": "===\n" * 60_000,
    "long names": "module " + "a" * 100_000 + " { struct b { " + "c d;" * 30_000 + "}; };",
    "long title": f"int8 x\n{LINE}\nMSG: {'a' * 100_000}/B\n" + "C d\n" * 30_000,
    "operators": module(f"const long X = 1{'+1' * 100_000};"),
    "arguments": module(f"struct A {{ @a({NESTED[:50_000]}{')' * 50_000}) long x; }};"),
    "nested sequences": module(f"struct A {{ {'sequence<' * 20_000}long{'>' * 20_000} x; }};"),
    "modules on a line": "module a { " * 20_000 + "struct A { b::C d; };",
    "typedefs": module("".join(f"typedef a{i} a{i + 1};" for i in range(9000))),
    "escapes": module(r"const string X = " + r"\"" * 100_000),
    "newlines of idl": "\n" * 250_000 + "module",
    "fields": "int8 a\n" * 30_000,
    "annotations": "@a " * 80_000,
    "a name": f"int8 {'a' * 250_000};",
    "a type": f"{'a/' * 120_000}; b",
}


@pytest.mark.parametrize("name", TEXTS)
def test_no_text_takes_longer_than_it_is_long(name: str) -> None:
    steps = 0

    def count(*_: object) -> None:
        nonlocal steps
        steps += 1

    text = TEXTS[name]
    sys.setprofile(count)
    try:
        assert differing_field(GRID_TYPE, text, 2) is not None
    finally:
        sys.setprofile(None)
    assert steps < 40 * len(text)
