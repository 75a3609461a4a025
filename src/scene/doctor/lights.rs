//! Is there one light, does it turn with the camera, or does it fall into groups?
//!
//! A fit explains all photos by one light that stands still in the world. On a turntable it is the camera that stands
//! still beside the light; and of photos taken in the morning and at noon each has its own. What tells is shading: over
//! points that several photos show, the logarithm of radiance is taken as reflectance of the point, gain of the view, and
//! a shading: a vector times the normal that stands still in the cameras, or that is another for each run of photos in the
//! order of their names, or for each of a few groups in any order; for what shines, a function of where normal and mirrored direction point in the camera (a light
//! that turns with it) against one of where the mirrored direction points in the world (a light that stands still: what its
//! normals say drops out with the reflectance). The share of the squared residuals that each of these takes away decides;
//! `shading` has the least squares.
//!
//! It refuses to judge where the photos share too little, and it takes no gloss for a light: what a light must explain is
//! larger than what highlights leave, and of what shines, half of what differs and clearly more than highlights of a light
//! that stands still.

use super::probe::{Probe, surface_at};
use super::shading::{Shares, Sight, Sighted, explain};
use super::{Report, names_of};
use crate::error::{Finding, Place, Severity};
use crate::math::{luminance, parallel};
use crate::scene::{PixelState, Scene, View};
use crate::trace::Bvh;
use glam::{DMat3, Vec3};

/// At most so many views are looked at, spread evenly.
const MOST_VIEWS: usize = 48;
/// Points that are looked at.
const POINTS: usize = 4000;
/// A point must be seen by so many views.
const FEWEST_SIGHTS: usize = 3;
/// With fewer points than this nothing is said.
const FEWEST_POINTS: usize = 200;
/// Below this radiance a pixel is dark: its logarithm is noise.
const DARK: f32 = 2e-3;
/// Share of the squared residuals that another light must take away.
const LEAST_SHARE: f64 = 0.25;
/// Share of what a light of its own for each photo takes away that the simpler explanation must reach.
const LEAST_PART: f64 = 0.55;
/// Root mean square of what it takes away, in natural logarithms of radiance: gloss under one light comes to 0.1.
const LEAST_SIZE: f64 = 0.15;
/// An explanation that takes away this share leaves no room for gloss, which follows none of them so closely; where it leaves
/// at most this part of what the next best leaves, it leads, and a smaller size is enough: a few percent of the radiance.
const SURE_SHARE: f64 = 0.9;
const SURE_PART: f64 = 0.5;
const LEAST_SIZE_IF_SURE: f64 = 0.05;
/// Share that a light turning with the camera must take away where it shines, and the part that it may leave of what one
/// leaves that stands still and shines. Both have as many unknowns, which explain half where views are few, turning or not;
/// of captures under one light that leave much to explain the part is 0.9 and more.
const LEAST_SHINE: f64 = 0.5;
const MOST_LEFT_BY_SHINE: f64 = 0.85;
/// Share that groups in any order must take away, and that of what a light for each photo does. Vectors that go around evenly
/// leave three groups two thirds of it.
const LEAST_SHARE_OF_ANY: f64 = 0.6;
const LEAST_PART_OF_ANY: f64 = 0.85;
/// Share that two groups must take away where there is little to explain, and that of what a light for each photo does: of
/// captures under one light they come to 0.2 and 0.7.
const LEAST_SHARE_IF_NEAT: f64 = 0.35;
const LEAST_PART_IF_NEAT: f64 = 0.85;
/// What a light that turns takes away is at most this part of that: of what both explain alike nothing is said.
const MOST_TURNING_IF_NEAT: f64 = 0.75;
/// What it leaves is at most this part of what the next best leaves.
const CLEAR_PART: f64 = 0.6;
/// Share that a light for each photo must take away where nothing simpler does: gloss under one light comes to 0.76.
const LEAST_SHARE_OF_EACH: f64 = 0.85;

/// How the shading of the photos goes with the cameras.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LightCheck {
    /// Root mean square of what one light leaves of the logarithms of radiance.
    pub one_light_residual: f64,
    /// Share of the squared residuals under one light that a light standing still in the cameras takes away, in [0, 1].
    pub with_camera: f64,
    /// The same for a light standing still in the cameras that may shine: a function of where normal and mirrored direction
    /// point there.
    pub shine_with_camera: f64,
    /// The same for a light standing still in the world that shines: a function of where the mirrored direction points.
    pub shine_in_world: f64,
    /// The same for the best cut of the photos, in the order of their names, into two groups with a light each.
    pub in_groups: f64,
    /// The same for a light of its own for each photo.
    pub of_each: f64,
    /// Name of the first view of the second group.
    pub second_group_begins: String,
    /// The same for two or three groups of photos in any order with a light each.
    #[serde(default)]
    pub in_any_groups: f64,
}

/// What the light of the photos is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightKind {
    /// One for all photos.
    One,
    /// One that turns with the camera.
    WithCamera,
    /// One for each of two groups of photos.
    InGroups,
    /// One for each of two or three groups of photos, in whatever order of names.
    InAnyGroups,
    /// Another from photo to photo, in no order that is known.
    OfEach,
}

impl LightCheck {
    /// Which explanation is believed: the simplest that is as good as any.
    pub fn kind(&self) -> LightKind {
        let is_large = |share: f64| self.size_of(share) > LEAST_SIZE;
        let explained = |share: f64| share > LEAST_SHARE && share > LEAST_PART * self.of_each && is_large(share);
        let shines = self.shine_with_camera > LEAST_SHINE
            && 1.0 - self.shine_with_camera < MOST_LEFT_BY_SHINE * (1.0 - self.shine_in_world)
            && self.shine_with_camera > self.in_groups
            && is_large(self.shine_with_camera);
        let turning = self.with_camera.max(self.shine_with_camera);
        let is_sure = |share: f64, other: f64| {
            share > SURE_SHARE
                && 1.0 - share < CLEAR_PART * (1.0 - other.max(self.shine_in_world))
                && self.size_of(share) > LEAST_SIZE_IF_SURE
        };
        // Where gloss under one light explains as much, nothing says that there is another.
        let turns = explained(self.with_camera) && self.with_camera >= self.in_groups.max(self.shine_in_world);
        let groups = explained(self.in_groups) && self.in_groups >= self.shine_in_world;
        // Groups that do nearly all that a light for each photo does are no gloss, however little differs.
        let is_neat = self.in_groups > LEAST_SHARE_IF_NEAT.max(self.shine_in_world)
            && self.in_groups > LEAST_PART_IF_NEAT * self.of_each
            && self.with_camera < MOST_TURNING_IF_NEAT * self.in_groups
            && self.size_of(self.in_groups) > LEAST_SIZE_IF_SURE;
        // Gloss of a camera that goes around falls into groups as well, but not so neatly, and it does not leave so little.
        let is_clear = |share: f64, least: f64| {
            share > least.max(LEAST_SHARE_OF_ANY)
                && 1.0 - share < SURE_PART * (1.0 - self.in_groups.max(turning).max(self.shine_in_world))
                && is_large(share)
        };
        if shines || turns || is_sure(turning, self.in_groups) {
            LightKind::WithCamera
        } else if groups || is_neat || is_sure(self.in_groups, turning) {
            LightKind::InGroups
        } else if is_clear(self.in_any_groups, LEAST_PART_OF_ANY * self.of_each) {
            LightKind::InAnyGroups
        } else if is_clear(self.of_each, LEAST_SHARE_OF_EACH) {
            LightKind::OfEach
        } else {
            LightKind::One
        }
    }

    /// Root mean square of what an explanation takes away that takes this share, in natural logarithms of radiance.
    fn size_of(&self, share: f64) -> f64 {
        self.one_light_residual * share.sqrt()
    }

    /// Whether photos differ so little from what one light makes of them that nothing is there to be explained.
    pub fn is_all_explained(&self) -> bool {
        self.one_light_residual < LEAST_SIZE_IF_SURE
    }
}

/// Measures the lights and says what they are.
pub fn check(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], report: &mut Report) {
    let step = scene.views.len().div_ceil(MOST_VIEWS).max(1);
    let is_usable = |view: &usize| !probes[*view].is_empty() && !report.views[*view].is_misplaced;
    let views: Vec<usize> = (0..scene.views.len()).step_by(step).filter(is_usable).collect();
    if views.len() < 4 {
        return;
    }
    let points = sighted(scene, bvh, probes, &views);
    if points.len() < FEWEST_POINTS {
        return;
    }
    let Some(shares) = explain(&points, views.len()) else { return };
    let name = |place: usize| scene.views[views[place]].name.as_str();
    let (cut, first) = (shares.cut, name(shares.cut));
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let Shares { residual, with_camera, shine_with_camera, shine_in_world, in_groups, of_each, .. } = shares;
    let in_any_groups = shares.in_any_groups;
    let found = LightCheck {
        one_light_residual: residual,
        with_camera,
        shine_with_camera,
        shine_in_world,
        in_groups,
        of_each,
        second_group_begins: first.into(),
        in_any_groups,
    };
    let remedy =
        "a fit takes one light for all photos, and bakes what differs into the maps: fit photos of one light alone";
    if found.kind() == LightKind::WithCamera {
        let message = format!(
            "the light turns with the camera, as on a turntable: that explains {} of how the shading of the same surface \
             differs between photos",
            percent(found.with_camera.max(found.shine_with_camera))
        );
        report.findings.push(
            Finding::new(Severity::Warning, "light-turns-with-camera", message)
                .remedy(format!("{remedy}, or move the camera around the object instead")),
        );
    } else if found.kind() == LightKind::InGroups {
        let (last, of_first) = (name(cut - 1), name(0));
        let message = format!(
            "the photos fall into two groups with a light each, {of_first} to {last} and {first} to {}: that explains {} of \
             how the shading of the same surface differs between photos",
            name(views.len() - 1),
            percent(found.in_groups)
        );
        report.findings.push(
            Finding::new(Severity::Warning, "light-in-groups", message).at(Place::View(first.into())).remedy(remedy),
        );
    }
    let told = match found.kind() {
        LightKind::InAnyGroups => {
            let members = |group: usize| {
                let names: Vec<&str> =
                    (0..views.len()).filter(|&view| shares.groups[view] == group).map(name).collect();
                names_of(&names)
            };
            let count = shares.groups.iter().max().map_or(0, |last| last + 1);
            let message = format!(
                "the photos fall into {count} groups with a light each: {}: that explains {} of how the shading of the same \
                 surface differs between photos",
                (0..count).map(members).collect::<Vec<_>>().join("; "),
                percent(in_any_groups)
            );
            Some(Finding::new(Severity::Warning, "light-in-groups", message))
        }
        LightKind::OfEach => {
            let message = format!(
                "the light differs from photo to photo: another for each explains {} of how the shading of the same surface \
                 differs between them",
                percent(of_each)
            );
            Some(Finding::new(Severity::Warning, "light-differs", message))
        }
        _ => None,
    };
    report.findings.extend(told.map(|told| told.remedy(remedy)));
    report.light = Some(found);
}

fn sighted(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], views: &[usize]) -> Vec<Sighted> {
    let rotations: Vec<DMat3> =
        views.iter().map(|&view| scene.views[view].camera.rotation_camera_from_world.as_dmat3()).collect();
    let from_each = POINTS.div_ceil(views.len());
    let places: Vec<(Vec3, Vec3, Vec3)> = views
        .iter()
        .flat_map(|&view| {
            let hits: Vec<_> = probes[view].iter().filter_map(|probe| probe.hit.as_ref()).collect();
            let step = (hits.len() / from_each).max(1);
            hits.into_iter().step_by(step).filter_map(|hit| surface_at(&scene.mesh, hit)).collect::<Vec<_>>()
        })
        .collect();
    let sighted = parallel::map_items(&places, |&(point, normal, shading)| {
        let normal_in_world = shading.as_dvec3();
        let sights: Vec<Sight> = views
            .iter()
            .zip(&rotations)
            .enumerate()
            .filter_map(|(place, (&view, rotation))| {
                let log = log_seen(scene, bvh, view, point, normal)?;
                let to_eye = (scene.views[view].camera.position_in_world() - point).as_dvec3().normalize_or_zero();
                Some(Sight::new(place, log, normal_in_world, to_eye, rotation))
            })
            .collect();
        (sights.len() >= FEWEST_SIGHTS).then_some(Sighted { normal: normal_in_world, sights })
    });
    sighted.into_iter().flatten().collect()
}

/// Logarithm of what a view sees at a point; `None` where it does not see it well.
fn log_seen(scene: &Scene, bvh: &Bvh, view: usize, point: Vec3, normal: Vec3) -> Option<f64> {
    let View { camera, photo, states, .. } = &scene.views[view];
    let place = camera.place_in_picture(point)?;
    let to_eye = camera.position_in_world() - point;
    if to_eye.dot(normal) < 0.3 * to_eye.length() {
        return None;
    }
    let (row, column) = (place.y as usize, place.x as usize);
    if states[(row, column)] != PixelState::Surface {
        return None;
    }
    let value = luminance(photo.radiance(row, column));
    (value > DARK && !bvh.is_hidden_from(point, normal, camera.position_in_world())).then(|| f64::from(value.ln()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_explains_nearly_all_and_leads_needs_less_size() {
        let of = |one_light_residual,
                  [with_camera, shine_with_camera, shine_in_world, in_groups, of_each]: [f64; 5]| {
            let second_group_begins = String::new();
            LightCheck {
                one_light_residual,
                with_camera,
                shine_with_camera,
                shine_in_world,
                in_groups,
                of_each,
                second_group_begins,
                in_any_groups: 0.0,
            }
            .kind()
        };
        // Two soft lights, and one that turns.
        assert_eq!(of(0.11, [0.66, 0.72, 0.05, 0.94, 0.97]), LightKind::InGroups);
        assert_eq!(of(0.14, [0.97, 0.99, 0.05, 0.62, 0.98]), LightKind::WithCamera);
        // Gloss, few views of it, noise, and what two explanations explain alike.
        assert_eq!(of(0.12, [0.06, 0.16, 0.67, 0.05, 0.7]), LightKind::One);
        assert_eq!(of(0.09, [0.69, 0.73, 0.58, 0.46, 0.76]), LightKind::One);
        assert_eq!(of(0.03, [0.1, 0.1, 0.0, 0.95, 0.97]), LightKind::One);
        assert_eq!(of(0.1, [0.9, 0.92, 0.1, 0.93, 0.97]), LightKind::One);
        // A facade in the shade and in the sun; and a capture under one light whose photos differ as little.
        assert_eq!(of(0.123, [0.29, 0.47, 0.14, 0.44, 0.47]), LightKind::InGroups);
        assert_eq!(of(0.11, [0.32, 0.35, 0.11, 0.08, 0.35]), LightKind::One);
        // A glossy head that turns, of few photos, and one that a photographer walks around.
        assert_eq!(of(0.27, [0.04, 0.68, 0.49, 0.05, 0.1]), LightKind::WithCamera);
        assert_eq!(of(0.28, [0.33, 0.46, 0.45, 0.2, 0.52]), LightKind::One);
        // Another light for each photo, and gloss of few views.
        assert_eq!(of(0.3, [0.12, 0.13, 0.02, 0.14, 0.93]), LightKind::OfEach);
        assert_eq!(of(0.09, [0.69, 0.73, 0.58, 0.46, 0.93]), LightKind::One);
        assert_eq!(of(0.3, [0.12, 0.13, 0.02, 0.14, 0.76]), LightKind::One);
    }
}
