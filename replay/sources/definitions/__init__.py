"""Whether a recording defines its messages as the standard does: `difference` tells, from what `text` states."""
