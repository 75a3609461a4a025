//! Which texels share a lobe: a tree of hypotheses over a tile, weighed by their evidence.
//!
//! Given F0, a width and the diffuse reflectance of a group, deviations of its texels are independent of each other, so
//! each can be integrated out, and what is left of a texel is six sums per channel and width. Sums of texels add up: any
//! group of texels can be asked how likely its pixels are if it shares one lobe, by a closed integral over the group's
//! diffuse reflectance and F0 and a sum over widths. What a kind of surface says of diffuse reflectance counts once a
//! group. Counted once a texel it outvoted the pixels: rough metals that are not black below came out as dielectrics.
//!
//! A group shares a lobe, or is cut into quarters, or into two by colour, each part with the same choice: Bayesian model
//! averaging over all prunings of a tree (Willems, Shtarkov and Tjalkens 1995, context-tree weighting). What comes out
//! is a mean and a variance per texel: where pixels say little, a texel leans on all that look alike around it.
//!
//! Two colours are not all that a tile has, so parts may be cut by colour again. There it is mostly hue that counts: grain
//! and dirt make one material lighter here and darker there, and pieces that differ in nothing else know less than the whole.
//!
//! Squares end somewhere, and nothing is shared across an edge. So several trees whose squares end at other texels are
//! grown, and what comes out is their mean, which has no such edges (Coifman and Donoho 1995, translation-invariant
//! de-noising). Weighed by their evidence one tree is all that counts, and roughness is further from the truth.
//!
//! [`super::lobe_evidence`] asks one group; here groups are made and weighed.

use super::lobe_evidence::{Evidence, LobeBelief, log_sum};
use super::lobe_prior::LobePrior;
use super::lobe_sums::LobeSumsOfGroup;
use super::lobe_widths::LOBE_WIDTHS;
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// A texel of a tile: where it lies and what tells it from others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeTexel {
    /// Row in the tile.
    pub row: u16,
    /// Column in the tile.
    pub column: u16,
    /// Diffuse reflectance.
    pub colour: [f32; 3],
}

impl TreeTexel {
    /// The same further down and to the right.
    fn shifted(&self, by: u16) -> Self {
        TreeTexel { row: self.row + by, column: self.column + by, ..*self }
    }
}

/// Which ways of sharing lobes over a tile are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LobeSharing {
    /// Trees that are grown, each with its squares elsewhere, from 1 to [`MOST_TREES`].
    pub trees: usize,
    /// How often a group may be cut by colour, one cut inside the parts of another.
    pub colour_cuts: u8,
}

impl LobeSharing {
    /// One tree, cut by colour once.
    pub const QUICK: LobeSharing = LobeSharing { trees: 1, colour_cuts: 1 };
    /// All that pays.
    pub const THOROUGH: LobeSharing = LobeSharing { trees: MOST_TREES, colour_cuts: 3 };
}

/// What tells two colours apart.
struct ColourCut {
    /// Share of a colour's grey that is left.
    grey: f32,
    /// Colours nearer than this, as a distance of reflectances, are one.
    least_difference: f32,
}

/// The first cut by colour,
const FIRST_CUT: ColourCut = ColourCut { grey: 1.0, least_difference: 0.03 };
/// and those inside of its parts. With all of the grey, specular reflectance and pictures are further
/// off.
const INNER_CUT: ColourCut = ColourCut { grey: 0.3, least_difference: 0.12 };

/// A group smaller than this is not cut by colour.
const LEAST_TO_CLUSTER: usize = 12;
/// Nor a square of fewer texels along its side.
const LEAST_SIDE_TO_CLUSTER: usize = 8;
/// Texels along the side of the smallest squares. One texel has too few pixels of its own for a lobe of its own: with
/// squares of one texel maps are the same, and three quarters of all groups are such squares.
const SMALLEST: usize = 2;

/// Texels along the side of the largest squares whose groups are kept, to be found again: as many as a mask has bits.
const MOST_SIDE_TO_KEEP: usize = 8;

/// Trees that can be grown over a tile; each is shifted by an eighth of the tile's side against the one before.
pub const MOST_TREES: usize = 4;

struct Node {
    texels: Vec<u32>,
    leaf: LobeBelief,
    log_leaf: f64,
    /// Cuts, each with its parts.
    cuts: Vec<Vec<Rc<Node>>>,
    log_evidence: f64,
}

/// What makes a group of texels of a small square: the square, which of its texels they are, and how often colours may
/// cut it.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct GroupKey {
    corner: (u16, u16),
    side: usize,
    mask: u64,
    cuts_left: u8,
}

/// The beliefs of all texels of a tile of `side` texels (a power of two, 8 at least), and what would be believed of one
/// lobe that all of them share, whatever the evidence for it.
pub fn beliefs(
    texels: &[TreeTexel],
    sums: &[LobeSumsOfGroup],
    side: usize,
    log_widths: &[f64; LOBE_WIDTHS],
    (prior, sharing): (&LobePrior, LobeSharing),
) -> (Vec<LobeBelief>, LobeBelief) {
    let mut around = [0.0f64; 3];
    for texel in texels {
        for (sum, value) in around.iter_mut().zip(texel.colour) {
            *sum += f64::from(value) / texels.len() as f64;
        }
    }
    let evidence = Evidence::new(around, log_widths, prior);
    let unseen = evidence.shared_lobe(&LobeSumsOfGroup::default());
    let is_seen: Vec<bool> = sums.iter().map(|sums| !sums.is_empty()).collect();
    let mut made = vec![LobeBelief::default(); texels.len()];
    let mut one = LobeBelief::default();
    let LobeSharing { trees, colour_cuts } = sharing;
    let trees = trees.clamp(1, MOST_TREES);
    for number in 0..trees {
        let shift = number * side / 8;
        let texels = texels.iter().map(|texel| texel.shifted(shift as u16)).collect();
        let (is_seen, evidence, kept) = (&is_seen, &evidence, RefCell::default());
        let tree = Tree { texels, sums, is_seen, unseen, evidence, prior, colour_cuts, kept };
        // A square that is shifted lies in one of twice its side.
        let side = if shift == 0 { side } else { 2 * side };
        let root = tree.grow((0..is_seen.len() as u32).collect(), (0, 0), side, colour_cuts);
        tree.spread(&root, 1.0 / trees as f64, &mut made);
        // The root of each tree has all texels.
        one = root.leaf;
    }
    for belief in made.iter_mut().chain([&mut one]) {
        for k in 0..4 {
            belief.square[k] = (belief.square[k] - belief.mean[k] * belief.mean[k]).max(0.0);
        }
    }
    (made, one)
}

struct Tree<'a> {
    texels: Vec<TreeTexel>,
    sums: &'a [LobeSumsOfGroup],
    /// Whether a texel has pixels of its own.
    is_seen: &'a [bool],
    /// Evidence and belief of groups without pixels.
    unseen: (f64, LobeBelief),
    evidence: &'a Evidence,
    prior: &'a LobePrior,
    /// How often all of its texels may be cut by colour.
    colour_cuts: u8,
    /// Small groups that were grown. Cuts by colour of all sizes lead to them again and again: where a colour fills a
    /// square, they are those of the square itself. On photographs that halves what asking all groups takes.
    kept: RefCell<HashMap<GroupKey, Rc<Node>>>,
}

impl Tree<'_> {
    /// The tree below a group of texels of a square, kept or grown, with so many cuts by colour left.
    fn grow(&self, texels: Vec<u32>, corner: (u16, u16), side: usize, cuts_left: u8) -> Rc<Node> {
        let cuts_left = if side >= LEAST_SIDE_TO_CLUSTER { cuts_left } else { 0 };
        if side > MOST_SIDE_TO_KEEP {
            return Rc::new(self.grown(texels, corner, side, cuts_left));
        }
        let mask = texels.iter().fold(0u64, |mask, &texel| {
            let TreeTexel { row, column, .. } = self.texels[texel as usize];
            mask | 1 << (usize::from(row - corner.0) * side + usize::from(column - corner.1))
        });
        let key = GroupKey { corner, side, mask, cuts_left };
        let kept = self.kept.borrow().get(&key).cloned();
        kept.unwrap_or_else(|| {
            let node = Rc::new(self.grown(texels, corner, side, cuts_left));
            self.kept.borrow_mut().insert(key, node.clone());
            node
        })
    }

    fn grown(&self, texels: Vec<u32>, corner: (u16, u16), side: usize, cuts_left: u8) -> Node {
        // Maps may be finer than photos: what has no pixels adds nothing.
        let mut seen = texels.iter().map(|&texel| texel as usize).filter(|&texel| self.is_seen[texel]);
        let (log_leaf, leaf) = match seen.next() {
            None => self.unseen,
            Some(first) => {
                let mut sums = self.sums[first].clone();
                seen.for_each(|texel| sums.add(&self.sums[texel]));
                self.evidence.shared_lobe(&sums)
            }
        };
        let mut cuts = Vec::new();
        if side > SMALLEST && texels.len() > 1 {
            let half = (side / 2) as u16;
            let mut quarters: [Vec<u32>; 4] = Default::default();
            for &texel in &texels {
                let own = &self.texels[texel as usize];
                let which = usize::from(own.row >= corner.0 + half) * 2 + usize::from(own.column >= corner.1 + half);
                quarters[which].push(texel);
            }
            let parts: Vec<Rc<Node>> = quarters
                .into_iter()
                .enumerate()
                .filter(|(_, quarter)| !quarter.is_empty())
                .map(|(which, quarter)| {
                    let corner = (corner.0 + half * (which / 2) as u16, corner.1 + half * (which % 2) as u16);
                    self.grow(quarter, corner, side / 2, cuts_left)
                })
                .collect();
            cuts.push(parts);
            let cut = if cuts_left == self.colour_cuts { FIRST_CUT } else { INNER_CUT };
            if cuts_left > 0
                && texels.len() >= LEAST_TO_CLUSTER
                && let Some(clusters) = self.two_colours(&texels, &cut)
            {
                cuts.push(clusters.into_iter().map(|part| self.grow(part, corner, side, cuts_left - 1)).collect());
            }
        }
        let log_evidence = if cuts.is_empty() {
            log_leaf
        } else {
            let cut = ((1.0 - self.prior.keep) / cuts.len() as f64).ln();
            let of_cuts = cuts.iter().map(|parts| cut + parts.iter().map(|part| part.log_evidence).sum::<f64>());
            log_sum(of_cuts.chain([self.prior.keep.ln() + log_leaf]))
        };
        Node { texels, leaf, log_leaf, cuts, log_evidence }
    }

    /// Mixes the beliefs of a node and of what lies below it into those of its texels.
    fn spread(&self, node: &Node, weight: f64, made: &mut [LobeBelief]) {
        if weight < 1e-4 {
            return;
        }
        let keep = if node.cuts.is_empty() {
            weight
        } else {
            weight * (self.prior.keep.ln() + node.log_leaf - node.log_evidence).exp()
        };
        for &texel in &node.texels {
            let belief = &mut made[texel as usize];
            belief.mix(&node.leaf, keep);
            belief.shared += keep * node.texels.len() as f64;
        }
        let cut = ((1.0 - self.prior.keep) / node.cuts.len().max(1) as f64).ln();
        for parts in &node.cuts {
            let log_cut = cut + parts.iter().map(|part| part.log_evidence).sum::<f64>();
            let weight = weight * (log_cut - node.log_evidence).exp();
            for part in parts {
                self.spread(part, weight, made);
            }
        }
    }

    /// Two clusters by colour (Lloyd's two means, started at the extremes along the brightest difference); `None` when
    /// one is nearly empty or they hardly differ.
    fn two_colours(&self, texels: &[u32], cut: &ColourCut) -> Option<[Vec<u32>; 2]> {
        let colour = |texel: u32| {
            let own = self.texels[texel as usize].colour;
            let grey_off = (1.0 - cut.grey) * (own[0] + own[1] + own[2]) / 3.0;
            own.map(|value| value - grey_off)
        };
        let distance = |a: [f32; 3], b: [f32; 3]| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>();
        let first = colour(*texels.first()?);
        let far = |from: [f32; 3]| {
            texels.iter().map(|&t| colour(t)).max_by(|&a, &b| distance(a, from).total_cmp(&distance(b, from)))
        };
        let one = far(first)?;
        let mut centres = [one, far(one)?];
        let nearer = |colour: [f32; 3], centres: &[[f32; 3]; 2]| {
            usize::from(distance(colour, centres[1]) < distance(colour, centres[0]))
        };
        for _ in 0..6 {
            let mut sums = [[0.0f32; 4]; 2];
            for &texel in texels {
                let own = colour(texel);
                let sum = &mut sums[nearer(own, &centres)];
                for c in 0..3 {
                    sum[c] += own[c];
                }
                sum[3] += 1.0;
            }
            for (centre, sum) in centres.iter_mut().zip(sums) {
                if sum[3] > 0.0 {
                    *centre = [0, 1, 2].map(|c| sum[c] / sum[3]);
                }
            }
        }
        let mut clusters: [Vec<u32>; 2] = Default::default();
        for &texel in texels {
            clusters[nearer(colour(texel), &centres)].push(texel);
        }
        let smallest = clusters[0].len().min(clusters[1].len());
        (smallest * 16 >= texels.len() && distance(centres[0], centres[1]) > cut.least_difference.powi(2))
            .then_some(clusters)
    }
}

#[cfg(test)]
mod tests;
