//! Maps that take over what judging views chose, where that is asked for.
//!
//! A region without a lobe gets F0 0 and the widest lobe: what maps can say of none is a lobe that is there at grazing
//! angles alone. One with one lobe gets that for all its texels. Diffuse reflectance of all texels is solved after this,
//! with what the chosen lobes send.

use super::super::diffuse_system::DiffuseRow;
use super::super::lobe_evidence::LobeBelief;
use super::super::tile::Tile;
use super::Alternative;
use super::alternatives::{ChosenLobe, TileAlternatives};
use super::choices::Choices;

/// What is kept of a tile so that its choice can be taken over.
pub struct Undecided {
    one: LobeBelief,
    rho: [Vec<[f32; 3]>; 2],
    lobes: Vec<ChosenLobe>,
}

impl Undecided {
    /// Of a tile's alternatives: the lobe that all its texels share is the one their diffuse reflectance was solved with.
    pub fn of(alternatives: &mut TileAlternatives) -> Self {
        let rho = [Alternative::Diffuse, Alternative::OneLobe].map(|choice| alternatives.rho[choice.index()].clone());
        let one = alternatives.one_belief;
        Undecided { one, rho, lobes: std::mem::take(&mut alternatives.chosen_lobes) }
    }

    /// Takes over what was chosen for a tile: its lobes, its reflectance, and the rows of its pixels.
    pub fn decide(&self, choices: &Choices, tile: &mut Tile, rows: &mut [DiffuseRow]) {
        let Some(&first) = tile.texels.first() else { return };
        let (chosen, belief) = match choices.map.pixels()[first as usize] {
            1.0 => {
                // As uncertain as a lobe that all share is.
                let square = self.one.square;
                (Alternative::Diffuse, LobeBelief { mean: [0.0; 4], square, shared: 0.0 })
            }
            2.0 => (Alternative::OneLobe, self.one),
            _ => return,
        };
        let shared = tile.texels.len() as f64;
        tile.lobes.fill(LobeBelief { shared, ..belief });
        tile.rho.clone_from(&self.rho[chosen.index()]);
        for lobe in &self.lobes {
            let sent = if chosen == Alternative::OneLobe { lobe.one } else { lobe.none };
            let row = &mut rows[lobe.observation as usize];
            (0..3).for_each(|c| row.radiance[c] += lobe.own[c] - sent[c]);
        }
    }
}
