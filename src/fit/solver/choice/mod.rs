//! Only what a scene needs: views that took no part say what each freedom of the model bought.
//!
//! The solver weighs lobes by the evidence of the pixels it is fitted to ([`super::lobe_tree`]). Here the outcome is put
//! before a judge: pixels of held-out views, or of every eighth training view where none is held out, withheld from this
//! check only. Per region, a tile of the maps, the simplest model within one standard error of the best is chosen: none,
//! one, or lobes of their own. For the scene as a whole it is told what light between surfaces and the resolution of the
//! light bought. Then:
//! 1. [`alternatives`]: a tile solved with less, in closed form, from the terms that are there already.
//! 2. [`student`]: how likely a residual is, with the noise that training pixels leave.
//! 3. [`judge`]: pixels of judging views under all alternatives, summed by region and view.
//! 4. [`clustered`]: means with standard errors over views, since pixels of one view go together.
//! 5. [`check`]: which views judge, and the way from tiles to what is chosen. [`choices`]: the outcome, for the report.
//!
//! No map changes: what is chosen is told, not taken over. Lobes of their own are means over all ways to cut the surface,
//! weighed by their evidence, so a texel that needs none of its own has one that is nearly its neighbours'; and a region
//! whose pixels no lobe explains better still has a roughness, which nothing but that evidence tells. Taken over, maps got
//! worse, roughness most of all.
//!
//! It costs two more solutions of diffuse reflectance for each alternative and no lobe's integral but at judging pixels, some
//! hundredths of the fit. Where views have to be withheld the beliefs about lobes are made once more.

pub mod alternatives;
pub mod check;
pub mod choices;
pub mod clustered;
pub mod judge;
pub mod student;

#[cfg(test)]
mod tests;

pub use choices::Choices;

/// Number of [`Alternative`]s.
pub const ALTERNATIVES: usize = 5;
/// The first so many of them differ by their lobes, the simplest first: regions choose among them.
pub const LOBE_ALTERNATIVES: usize = 3;

/// A model that held-out views judge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alternative {
    /// No lobe.
    Diffuse,
    /// One lobe for all texels of a region.
    OneLobe,
    /// The solver's own: lobes shared as the evidence says.
    OwnLobes,
    /// The solver's own lobes; diffuse reflectance sees only light that comes straight from the environment.
    DirectLight,
    /// The solver's own maps under its light at half the resolution.
    HalfLight,
}

impl Alternative {
    /// All of them, in the order of their indices.
    pub const ALL: [Alternative; ALTERNATIVES] = [
        Alternative::Diffuse,
        Alternative::OneLobe,
        Alternative::OwnLobes,
        Alternative::DirectLight,
        Alternative::HalfLight,
    ];

    /// Its place in [`Alternative::ALL`].
    pub fn index(self) -> usize {
        self as usize
    }
}
