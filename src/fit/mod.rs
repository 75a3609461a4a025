//! Where a texel is changed.
