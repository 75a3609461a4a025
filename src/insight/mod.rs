//! What can be said about a fit: scores and the report.
//!
//! Read [`scores`] first: how a picture is compared with a photograph, and which pixels count. [`truth`] compares maps
//! and light with a known truth, [`intervals`] stated uncertainties with it, [`protocols`] scores pictures by the rules of
//! published benchmarks, [`report`] makes the one page that shows it all.
//! Every score comes twice, raw and scale-aligned, because reflectance times c with light over c is the same picture.
//!
//! [`capture`] tells after a fit what is wrong with photos, cameras, masks or mesh.
//! [`coverage`] counts which texels photographs see. [`cursor`] leads
//! between photo, surface and map; [`record`] says what each photo and the model say of one point,
//! [`surface_layers`] what all photos together say of each texel, [`projected_photos`] lays them on it before any fit. [`material_pictures`] shows measured reflectance.
//!
//! What this folder refuses to do: it changes no map, and scores only pictures that are handed to it.

pub mod capture;
pub mod coverage;
pub mod cursor;
pub mod intervals;
pub mod label;
pub mod material_pictures;
pub mod memory;
pub mod nearest_photo;
pub mod plausible;
pub mod plot;
pub mod projected_photos;
pub mod protocols;
pub mod record;
pub mod report;
pub mod scores;
pub mod surface_layers;
pub mod truth;
