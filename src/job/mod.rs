//! The only door between a fit and whoever watches it.
