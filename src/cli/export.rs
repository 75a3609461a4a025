//! `patina export`.

use crate::error::{Finding, Result};
use crate::export::texture::TextureFormat;
use crate::job::export::{ExportEvent, ExportOptions, Forecast, Format, export as run};
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Options of `patina export`.
#[derive(Debug, Args)]
pub struct ExportArguments {
    /// The run folder; it is only read.
    pub run: PathBuf,
    /// What to export for; each gets a folder of its name.
    #[arg(long, value_enum, value_delimiter = ',', num_args = 1.., required = true)]
    pub to: Vec<Format>,
    /// Width of the maps in texels, 16 to 16384; that of the run when not given.
    #[arg(long)]
    pub size: Option<usize>,
    /// Kind of the texture files; in GLB and USD png8 chooses 8 bits and all others 16.
    #[arg(long, value_enum, default_value = "png16")]
    pub textures: TextureFormat,
    /// Carry the maps over to this mesh of the same place (OBJ, PLY, glTF or GLB with texture coordinates), by rays along its normals.
    #[arg(long, value_name = "MESH")]
    pub onto: Option<PathBuf>,
    /// Write the cameras of the run's scene too, as cameras.json in the convention of OpenCV.
    #[arg(long)]
    pub cameras: bool,
    /// The folder to make, `export` in the run folder when not given; an earlier export there is replaced.
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}

/// Exports a run for other programs. Ctrl-C ends it after the format at hand, and what was written is removed.
pub fn export(arguments: &ExportArguments, json: bool) -> Result<()> {
    let options = ExportOptions {
        run: arguments.run.clone(),
        output: arguments.output.clone().unwrap_or_else(|| arguments.run.join("export")),
        formats: arguments.to.clone(),
        size: arguments.size,
        onto: arguments.onto.clone(),
        cameras: arguments.cameras,
        textures: arguments.textures,
    };
    let stop = Arc::new(AtomicBool::new(false));
    super::interrupt::stop_on_interrupt(Arc::clone(&stop));
    let exported = run(&options, &stop, &|event| tell(&event, json))?;
    if json {
        println!("{}", serde_json::json!({"event": "exported", "export": exported}));
        return Ok(());
    }
    for (format, sentences) in &exported.losses {
        sentences.iter().for_each(|sentence| println!("{}: {sentence}", format.name()));
    }
    println!("{}", exported.folder.display());
    Ok(())
}

fn tell(event: &ExportEvent, json: bool) {
    if json {
        let line = match event {
            ExportEvent::Forecast(forecast) => serde_json::json!({"event": "forecast", "forecast": forecast}),
            ExportEvent::Stage(what, share) => serde_json::json!({"event": "stage", "stage": what, "share": share}),
            ExportEvent::Finding(finding) => serde_json::json!({"event": "finding", "finding": finding}),
            ExportEvent::Written(format) => serde_json::json!({"event": "format", "format": format}),
        };
        println!("{line}");
        return;
    }
    match event {
        ExportEvent::Forecast(forecast) => tell_forecast(forecast),
        ExportEvent::Stage(what, share) => eprintln!("{what} ({:.0} %)", 100.0 * share),
        ExportEvent::Finding(finding) => tell_finding(finding),
        ExportEvent::Written(_) => {}
    }
}

fn tell_forecast(forecast: &Forecast) {
    let megabytes = |bytes: u64| bytes.div_ceil(1_000_000);
    let ((width, height), memory, disk) = (forecast.texels, forecast.peak_bytes, forecast.largest_disk_bytes);
    eprintln!(
        "maps of {width} x {height}: about {} MB of memory, at most {} MB on disk",
        megabytes(memory),
        megabytes(disk)
    );
}

fn tell_finding(finding: &Finding) {
    eprintln!("{finding}");
}
