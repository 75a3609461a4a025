//! Frames into one file that plays: MP4 where the machine has `ffmpeg`, an animated PNG otherwise.
//!
//! An animated PNG (W3C PNG, third edition, 4.9) plays in browsers and keeps every colour; programs that cut films want MP4.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::image::{Image, file};
use std::io::ErrorKind as IoErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Frames of a film that is shown in a second.
pub const FRAMES_A_SECOND: u16 = 24;

/// Writes the frames (PNG files of one size, numbered from 0 as `frame_0000.png`, in this folder) as one film beside them.
/// Returns its path.
///
/// # Errors
/// No frames, frames that cannot be read, a folder that cannot be written.
pub fn write(folder: &Path, frames: &[PathBuf], name: &str) -> Result<PathBuf> {
    if frames.is_empty() {
        return Err(Error::new(ErrorKind::InvalidSetting, "a film without frames")
            .at(Place::File(folder.into()))
            .remedy("ask for at least one frame"));
    }
    match by_program(folder, name) {
        Some(film) => Ok(film),
        None => animated_png(folder, frames, name),
    }
}

/// The film by a program of this machine; `None` where it is not there or does not manage.
fn by_program(folder: &Path, name: &str) -> Option<PathBuf> {
    let film = folder.join(format!("{name}.mp4"));
    // It goes to another name until it is whole.
    let begun = folder.join(format!("{name}.part.mp4"));
    let status = Command::new("ffmpeg")
        .args(["-y", "-loglevel", "error", "-framerate", &FRAMES_A_SECOND.to_string(), "-i"])
        .arg(folder.join("frame_%04d.png"))
        // Sides must be even for what players understand.
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-movflags", "+faststart"])
        .arg(&begun)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    match status {
        Ok(status) if status.success() && std::fs::rename(&begun, &film).is_ok() => Some(film),
        Err(error) if error.kind() == IoErrorKind::NotFound => None,
        _ => {
            // What was begun is of no use; that it cannot be removed changes nothing.
            let _ = std::fs::remove_file(&begun);
            None
        }
    }
}

/// The film as an animated PNG that plays for ever.
fn animated_png(folder: &Path, frames: &[PathBuf], name: &str) -> Result<PathBuf> {
    let path = folder.join(format!("{name}.png"));
    let failed = |error: png::EncodingError| {
        Error::new(ErrorKind::Internal, format!("the film cannot be encoded: {error}"))
            .at(Place::File(path.clone()))
            .remedy("the single frames are whole: cut a film of them with another program")
    };
    let read = |frame: &PathBuf| -> Result<Image<[u8; 3]>> { file::read_srgb8(frame) };
    let first = read(&frames[0])?;
    let (width, height) = (first.width(), first.height());
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(frames.len() as u32, 0).map_err(failed)?;
    encoder.set_frame_delay(1, FRAMES_A_SECOND).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    for frame in frames {
        let image = read(frame)?;
        if (image.width(), image.height()) != (width, height) {
            return Err(Error::new(ErrorKind::Malformed, "the frames differ in size")
                .at(Place::File(frame.clone()))
                .remedy("render the turntable again into an empty folder"));
        }
        writer.write_image_data(image.pixels().as_flattened()).map_err(failed)?;
    }
    writer.finish().map_err(failed)?;
    write_bytes(&path, &bytes)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_become_an_animated_png_that_a_decoder_reads() {
        let folder = tempfile::tempdir().unwrap();
        let frames: Vec<PathBuf> = (0..3u8)
            .map(|number| {
                let path = folder.path().join(format!("frame_{number:04}.png"));
                file::write_png_srgb8(&path, &Image::filled(5, 3, [number * 80, 10, 20])).unwrap();
                path
            })
            .collect();
        let film = animated_png(folder.path(), &frames, "turntable").unwrap();
        let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&film).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
        let mut pixels = vec![0; 45];
        for number in 0..3u8 {
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(&pixels[..3], [number * 80, 10, 20]);
        }
        // Whatever the machine has, a film comes of it.
        assert!(write(folder.path(), &frames, "again").unwrap().is_file());
        assert!(write(folder.path(), &[], "none").is_err());
        file::write_png_srgb8(&frames[2], &Image::filled(4, 3, [0; 3])).unwrap();
        assert!(animated_png(folder.path(), &frames, "uneven").is_err());
        assert!(!folder.path().join("uneven.png").exists(), "nothing half");
    }
}
