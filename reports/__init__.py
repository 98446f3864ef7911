"""Tables, figures and pages from stored records. Reads records and samples files only; knows nothing of bench."""
