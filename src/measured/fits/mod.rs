//! Published fits of the MERL materials: small files from which whole tables are made again.
//!
//! [`neural`] holds the fits of which everything here is measured and learned; call it "MERL via neural fits".
//! [`published`] reads tables of parameters of analytic models, [`formula`] evaluates them: they were fitted by others to
//! the measurements themselves, and so are an independent check of the neural fits.

pub mod formula;
pub mod neural;
pub mod published;

pub use neural::{NeuralFit, NeuralFits};
pub use published::PublishedFits;

/// What data every table that is made of the neural fits names.
pub const DATA_STATEMENT: &str = "Data: MERL via neural fits (Sztrajman et al. 2021), not MERL itself.";
