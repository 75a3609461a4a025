//! What can be said about a fit: coverage, comparison, report.
