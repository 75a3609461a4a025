//! Where light is added up.
