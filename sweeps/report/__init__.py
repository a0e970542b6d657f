"""Report of a sweep: tables, figures and the report page."""
