//! `patina compare --protocol`: a run by the rules of a published benchmark.

use crate::error::Result;
use crate::job::benchmark::{Drawing, Protocol, Question, Score, Scored, orb, owl};
use crate::scene::Scene;
use std::path::Path;

/// Scores all pictures of a data set's folder, prints each and the means.
pub fn compare(protocol: Protocol, folder: &Path, scene: &Scene, drawing: &Drawing, json: bool) -> Result<()> {
    let mut tell = |scored: &Scored| match json {
        true => println!("{}", serde_json::json!({"event": "picture", "picture": scored})),
        false => println!("{:28} {:12} {}", scored.name, label(scored.question), text(&figures(&scored.score))),
    };
    let all = match protocol {
        Protocol::Orb => orb::score(folder, &scene.world_from_source, drawing, &mut tell)?,
        Protocol::Owl => owl::score(folder, &scene.world_from_source, drawing, &mut tell)?,
    };
    for question in [Question::NovelView, Question::Relighting] {
        let asked: Vec<_> = all.iter().filter(|own| own.question == question).map(|own| figures(&own.score)).collect();
        let Some(first) = asked.first() else { continue };
        let means: Vec<(&str, f64)> = (0..first.len())
            .map(|at| (first[at].0, asked.iter().map(|own| own[at].1).sum::<f64>() / asked.len() as f64))
            .collect();
        match json {
            true => {
                let score: serde_json::Map<_, _> =
                    means.iter().map(|(name, mean)| ((*name).to_owned(), (*mean).into())).collect();
                println!(
                    "{}",
                    serde_json::json!({"event": "aggregate", "name": label(question), "pictures": asked.len(),
                    "score": score})
                );
            }
            false => println!("{} of {} pictures: {}", label(question), asked.len(), text(&means)),
        }
    }
    Ok(())
}

fn label(question: Question) -> &'static str {
    match question {
        Question::NovelView => "novel view",
        Question::Relighting => "relighting",
    }
}

/// The figures that are averaged, by the names of the benchmark.
fn figures(score: &Score) -> Vec<(&'static str, f64)> {
    match score {
        Score::Orb(own) => vec![("PSNR-H", own.psnr_hdr_db), ("PSNR-L", own.psnr_ldr_db), ("SSIM", own.ssim)],
        Score::Owl(own) => vec![("PSNR", own.psnr_db), ("SSIM", own.ssim)],
    }
}

fn text(figures: &[(&str, f64)]) -> String {
    let written = figures.iter().map(|(name, value)| match name.starts_with("PSNR") {
        true => format!("{name} {value:.2} dB"),
        false => format!("{name} {value:.4}"),
    });
    written.collect::<Vec<_>>().join(", ")
}
