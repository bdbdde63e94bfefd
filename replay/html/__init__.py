"""The report as one page: what a run tells, section by section, and how it is drawn."""
