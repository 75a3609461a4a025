//! The lobes of a plan as rows over the hats of the light: what turns the light pays for no lobe again.

use super::{GROUPS_AT_ONCE, Group, LobePlan, NO_PLACE, width_of};
use crate::math::parallel;
use crate::render::cached::light_basis::LightBasis;
use crate::render::cached::lobe_frozen::{FrozenLobes, FrozenScratch};
use crate::render::cached::lobe_place::{LobePlace, LobeSums};
use crate::render::cached::seen_light::SeenLight;
use crate::render::cached::{CachedTransport, LightPlanes, PointLight, SeenRows, ShadingPoint, ViewFootprints};
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// So many times these are frozen before it is looked how much memory they take.
const CHUNKS_OF_A_BATCH: usize = 64;
/// Memory of frozen lobes, at most; the others are integrated anew under every light.
const MOST_FROZEN_BYTES: usize = 192 << 20;

/// A lobe of a view.
struct Lobe {
    normal: Vec3,
    to_viewer: Vec3,
    width: f32,
}

/// The hats that a lobe of this width is summed over, and whether these are pairs.
fn basis_of(transport: &CachedTransport, width: f32) -> (&LightBasis, bool) {
    match width >= transport.joined_from() {
        true => (&transport.joined_basis, true),
        false => (&transport.basis, false),
    }
}

impl LobePlan {
    /// Whether [`LobePlan::freeze`] came to its end.
    pub fn is_frozen(&self) -> bool {
        !self.frozen.is_empty()
    }

    /// Keeps the lobes as rows over the hats, so that their integrals under further lights cost a fraction. Where `stop` is
    /// raised nothing changes.
    pub fn freeze(&mut self, footprints: &ViewFootprints, transport: &CachedTransport, stop: &AtomicBool) {
        let fine = vec![u8::MAX; transport.basis.padded()];
        let all_seen = |basis: &LightBasis| &fine[..basis.padded()];
        let of_groups = |_: usize, groups: &[Group]| -> FrozenLobes {
            let (mut rows, mut scratch, seen) =
                (FrozenLobes::default(), FrozenScratch::default(), SeenLight::default());
            for group in groups.iter().filter(|_| !stop.load(Ordering::Relaxed)) {
                self.each_lobe(group, (footprints, transport), &mut |lobe| {
                    let (basis, _) = basis_of(transport, lobe.width);
                    let Lobe { normal, to_viewer, width } = lobe;
                    let (shares, model) = (all_seen(basis), transport.settings.lobe);
                    let place = LobePlace { normal, to_viewer, shares, seen: &seen, normal_variance: 0.0, model };
                    rows.add(basis, &place, width, &mut scratch);
                });
            }
            rows
        };
        let (mut frozen, mut bytes) = (Vec::new(), 0);
        for batch in self.groups.chunks(GROUPS_AT_ONCE * CHUNKS_OF_A_BATCH) {
            let rows = parallel::map_chunks(batch, GROUPS_AT_ONCE, of_groups);
            bytes += rows.iter().map(FrozenLobes::bytes).sum::<usize>();
            if bytes > MOST_FROZEN_BYTES {
                break;
            }
            frozen.extend(rows);
        }
        if !stop.load(Ordering::Relaxed) {
            self.frozen = frozen;
        }
    }

    /// The lobes of a group: those of its place by rising width, then those of the shading points with their own.
    fn each_lobe(
        &self,
        group: &Group,
        (footprints, transport): (&ViewFootprints, &CachedTransport),
        take: &mut dyn FnMut(Lobe),
    ) {
        if group.place != NO_PLACE {
            let own = &self.places[group.place as usize];
            let (normal, to_viewer) = (transport.grid.points[own.grid_point as usize].shading_normal, own.to_viewer);
            let [first, last] = own.steps.map(usize::from);
            (first..=last).for_each(|step| take(Lobe { normal, to_viewer, width: width_of(step) }));
        }
        for &index in &self.alone[group.alone.clone()] {
            let ShadingPoint { normal, to_viewer, .. } = footprints.points[index as usize];
            take(Lobe { normal, to_viewer, width: self.widths[index as usize] });
        }
    }

    /// The integrals of the lobes of groups from their rows: those of places, and of the shading points with their own.
    pub(super) fn frozen_sums(
        &self,
        (rows, groups): (&FrozenLobes, &[Group]),
        (footprints, transport): (&ViewFootprints, &CachedTransport),
        (light, at): (&LightPlanes, &PointLight),
    ) -> (Vec<LobeSums>, Vec<LobeSums>) {
        let (mut seen, mut scratch) = (SeenRows::default(), FrozenScratch::default());
        let (mut of_places, mut of_alone, mut row) = (Vec::new(), Vec::new(), 0);
        for group in groups {
            let grid_point = match group.place {
                NO_PLACE => footprints.points[self.alone[group.alone.start] as usize].lobe_point,
                place => self.places[place as usize].grid_point,
            };
            transport.gather_seen(grid_point, light, at, &mut seen.fine);
            if group.place != NO_PLACE {
                let own = &self.places[group.place as usize];
                let [first, end] = [own.steps[0], own.steps[1] + 1].map(usize::from);
                let joined = (first..end).find(|&step| basis_of(transport, width_of(step)).1).unwrap_or(end);
                let (begin, middle, end) = (row, row + joined - first, row + end - first);
                let fine = (&transport.basis, own.to_viewer);
                of_places.extend(rows.sums(begin..middle, fine, &seen.fine, &mut scratch));
                if middle < end {
                    let pairs = (&transport.joined_basis, own.to_viewer);
                    of_places.extend(rows.sums(middle..end, pairs, seen.joined(&transport.basis), &mut scratch));
                }
                row = end;
            }
            for &index in &self.alone[group.alone.clone()] {
                let to_viewer = footprints.points[index as usize].to_viewer;
                let (basis, is_joined) = basis_of(transport, self.widths[index as usize]);
                let seen = if is_joined { seen.joined(&transport.basis) } else { &seen.fine };
                of_alone.extend(rows.sums(row..row + 1, (basis, to_viewer), seen, &mut scratch));
                row += 1;
            }
        }
        (of_places, of_alone)
    }
}
