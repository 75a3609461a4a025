//! Studies as lists of cases that sittings work off, however many it takes.
//!
//! A case is one line of a results file ([`line`](mod@line)), appended as the case ends; [`results`] reads and appends,
//! [`order`] says in which order cases are taken, [`pattern`] which, and [`sitting`] takes them until the list, the budget
//! or the patience ends. Read [`sitting`] first.
//!
//! What stands in a results file is not done again, unless it was done by an older version of the method or from other
//! inputs: such a line is void, and stays where it is as history. A case that failed is a result.
//!
//! What this folder refuses to do: it knows no figure and judges nothing. Each study makes its own tables of its lines.

pub mod line;
pub mod order;
pub mod pattern;
pub mod results;
pub mod sitting;

pub use line::CaseLine;
pub use order::StudyCase;
pub use pattern::CasePattern;
pub use results::Results;
pub use sitting::{Sitting, Tally};
