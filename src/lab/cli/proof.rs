//! `patina-lab proof`.

use crate::cli::interrupt::stop_on_interrupt;
use crate::error::{Error, ErrorKind, Result};
use crate::lab::proof::{self, ProofOptions};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Proves exports by other programs; a bar that is missed is an error.
pub fn prove(options: &ProofOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let table = proof::run(options, &stop, &super::contest::teller("proof", json))?;
    if json {
        println!("{}", serde_json::json!({"event": "proof", "table": table}));
    } else {
        println!("{}", table.to_markdown());
    }
    let missed = table.missed();
    if missed.is_empty() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Numerical, format!("{} of the proof fell short: {}", missed.len(), missed.join("; ")))
        .remedy("the table says by how much; pictures of each row lie in the folder `pictures` beside it"))
}
