"""Read tables of text as people, instruments and loggers write them: dialect, header, units, numbers and times."""
