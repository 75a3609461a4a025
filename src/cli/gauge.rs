//! `patina rescale`, also known as `gauge`.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::job::gauge::{Move, move_run};
use clap::Args;
use glam::{Vec2, Vec3};
use std::path::PathBuf;

/// Options of `patina rescale`.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("by").required(true).args(["factor", "patch"])))]
pub struct GaugeOptions {
    /// The run folder; it is only read.
    pub run: PathBuf,
    /// Multiply reflectance by this factor, or by these three for red, green and blue; the environment is divided by it.
    #[arg(long, value_name = "R,G,B", value_delimiter = ',', num_args = 1)]
    pub factor: Vec<f32>,
    /// Give the diffuse map this reflectance at a place, as 0.25,0.75=0.18 (v is up); three values make it a colour.
    #[arg(long, value_name = "U,V=REFLECTANCE")]
    pub patch: Option<String>,
    /// Radius of the patch in texels.
    #[arg(long, default_value_t = 2, requires = "patch")]
    pub radius: usize,
    /// The new run folder.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Moves a run along the freedom between reflectance and light.
pub fn gauge(options: &GaugeOptions, json: bool) -> Result<()> {
    let by = match &options.patch {
        Some(text) => {
            let (uv, target) = patch_of(text).ok_or_else(|| {
                Error::new(ErrorKind::InvalidSetting, format!("{text} is no patch"))
                    .at(Place::Setting("patch".into()))
                    .remedy("write u,v=reflectance, as 0.25,0.75=0.18")
            })?;
            Move::Patch { uv, radius_texels: options.radius, target }
        }
        None => Move::Factor(channels(&options.factor).ok_or_else(|| {
            Error::new(ErrorKind::InvalidSetting, format!("{} numbers are no factor", options.factor.len()))
                .at(Place::Setting("factor".into()))
                .remedy("give one number, or three for red, green and blue")
        })?),
    };
    let moved = move_run(&options.run, &by, &options.output)?;
    if json {
        let (factor, bounded) = (moved.factor.to_array(), moved.bounded_share);
        let line = serde_json::json!({
            "event": "gauge", "factor": factor, "bounded_share": bounded, "findings": moved.findings,
            "run": options.output,
        });
        println!("{line}");
    } else {
        let [red, green, blue] = moved.factor.to_array();
        println!("reflectance times {red:.4} {green:.4} {blue:.4}, light over it: {}", options.output.display());
        moved.findings.iter().for_each(|finding| println!("{finding}"));
    }
    Ok(())
}

/// One number for all channels, or three.
fn channels(values: &[f32]) -> Option<Vec3> {
    match values {
        [all] => Some(Vec3::splat(*all)),
        [red, green, blue] => Some(Vec3::new(*red, *green, *blue)),
        _ => None,
    }
}

fn patch_of(text: &str) -> Option<(Vec2, Vec3)> {
    let numbers = |part: &str| part.split(',').map(|number| number.trim().parse().ok()).collect::<Option<Vec<f32>>>();
    let (place, value) = text.split_once('=')?;
    match numbers(place)?.as_slice() {
        [u, v] => Some((Vec2::new(*u, *v), channels(&numbers(value)?)?)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_read_and_strange_ones_are_not() {
        assert_eq!(patch_of("0.25,0.75=0.18"), Some((Vec2::new(0.25, 0.75), Vec3::splat(0.18))));
        assert_eq!(patch_of("0, 1=0.1,0.2,0.3"), Some((Vec2::Y, Vec3::new(0.1, 0.2, 0.3))));
        for wrong in ["", "0.2=0.3", "0.1,0.2", "0.1,0.2=a", "0.1,0.2=0.1,0.2", "0.1,0.2,0.3=0.5"] {
            assert_eq!(patch_of(wrong), None, "{wrong}");
        }
    }
}
