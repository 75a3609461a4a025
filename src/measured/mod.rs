//! Measured reflectance: tables over half and difference angles, models with few parameters that stand for them, and
//! the figures by which the two are held against each other.
//!
//! Read [`coordinates`] first: everything here is a function of those three angles. [`grid`] is where a table has its
//! nodes, [`table`] the table itself with its lookup, [`binary`] its file, [`fits`] where the tables of 88 materials
//! come from. [`model`] is the one interface by which tables, analytic models and neural models are fitted and rendered;
//! [`analytic`] holds the models without a net, [`fit_model`] fits them, [`baseline`] names them, [`metrics`] and
//! [`sphere`] say how well.
//!
//! What is not here: nets, and anything that estimates reflectance from a photograph.

pub mod analytic;
pub mod baseline;
pub mod binary;
pub mod category;
pub mod coordinates;
pub mod fit_model;
pub mod fits;
pub mod grid;
pub mod metrics;
pub mod model;
pub mod sphere;
pub mod sphere_error;
pub mod table;

pub use category::Category;
pub use coordinates::HalfDifference;
pub use fits::NeuralFits;
pub use model::ReflectanceModel;
pub use table::MeasuredBrdf;
