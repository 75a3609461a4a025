//! Maps that are given, for a fit that keeps them.

use crate::error::{Error, ErrorKind, Place};
use crate::image::GreyImage;
use crate::material::MaterialMaps;

/// Maps that are kept, of any power of two, square.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownMaps {
    /// The maps, handed on bit for bit.
    pub maps: MaterialMaps,
    /// In how many photos of their own run each texel was seen; one that was seen in none is a guess and says nothing.
    pub times_seen: GreyImage,
}

/// Maps are to be kept, and none are named.
pub(crate) fn none_given() -> Error {
    Error::new(ErrorKind::InvalidSetting, "maps are to be kept, and none are given")
        .at(Place::Setting("fixed-maps".into()))
        .remedy("name the run that has them: --maps RUN")
}
