//! The list that the parts of a packet share.

use crate::math::vector::WIDEST;

/// One number of each path.
pub(super) type Lanes = [f32; WIDEST];
