//! OpenEXR: any flat layer with half, float or integer channels is read; scanline ZIP with floats is written.
//!
//! A file may hold many layers and channels. For colour, channels named `R G B` are taken first, then `*.R *.G *.B` of
//! one group (a group called `Combined` before others, else the first in the file), then a lone luminance. For grey, `Y`,
//! then a lone channel of any name, then the luminance of the colour. Alpha is left out; colour is as stored.
//! The image is the data window: a display window around or inside it is ignored.

use super::guard::guarded;
use super::source::{Source, implausible, malformed, too_large};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{GreyImage, Image, RgbImage};
use exr::prelude as openexr;
use exr::prelude::{ReadChannels, ReadLayers, WritableImage};
use glam::Vec3;
use std::io::{BufRead, Cursor, Seek, Write};
use std::path::Path;

/// Largest size of all decoded samples of a file.
const LARGEST_DECODED: u64 = 1 << 32;
/// Most bytes that deflate can make of one (1032), with room for headers.
const BEST_DEFLATE_RATIO: u64 = 1_100;

/// (width, height) of the image that would be read, after a check of all that the file claims.
pub fn size(reader: &mut (impl BufRead + Seek), path: &Path, length: u64) -> Result<(usize, usize)> {
    let outcome = guarded(path, || Ok(exr::meta::MetaData::read_from_buffered(&mut *reader, false)))?;
    let byte = reader.stream_position().unwrap_or(0);
    let headers = outcome.map_err(|error| explain(error, path, byte))?.headers;
    let mut decoded = 0u64;
    for header in headers.iter().filter(|header| !header.deep) {
        let (width, height) = (header.layer_size.width() as u64, header.layer_size.height() as u64);
        let pixels = width.saturating_mul(height);
        if pixels > super::source::LARGEST_PIXEL_COUNT {
            return Err(too_large(path, format!("the file claims {width} x {height} pixels")));
        }
        let sample_bytes: usize =
            header.channels.list.iter().map(|channel| channel.sample_type.bytes_per_sample()).sum();
        let bytes = pixels.saturating_mul(sample_bytes as u64);
        let ratio = match header.compression {
            openexr::Compression::Uncompressed => 1,
            openexr::Compression::ZIP1 | openexr::Compression::ZIP16 | openexr::Compression::RLE => BEST_DEFLATE_RATIO,
            _ => u64::MAX,
        };
        if bytes / ratio > length {
            return Err(implausible(
                path,
                format!("{length} bytes cannot hold the {width} x {height} pixels it claims"),
            ));
        }
        decoded = decoded.saturating_add(bytes);
    }
    if decoded > LARGEST_DECODED {
        return Err(too_large(path, format!("all layers together claim {decoded} bytes")));
    }
    // The layer that holds the picture tells the size; a file without one has no size to speak of.
    let names: Vec<Vec<String>> = headers
        .iter()
        .map(|header| match header.deep {
            true => Vec::new(),
            false => header.channels.list.iter().map(|channel| channel.name.to_string()).collect(),
        })
        .collect();
    let layer = choose_rgb(&names).map(|choice| choice.layer).or_else(|| choose_grey(&names)).unwrap_or(0);
    if headers.iter().all(|header| header.deep) {
        return Err(unsupported(path, "deep pixels are not read".into()));
    }
    let size = headers[layer.min(headers.len() - 1)].layer_size;
    Ok((size.width(), size.height()))
}

/// Where the colour is: a layer and three of its channels.
struct RgbChoice {
    layer: usize,
    channels: [usize; 3],
}

/// The channels of colour among `names[layer][channel]`.
fn choose_rgb(names: &[Vec<String>]) -> Option<RgbChoice> {
    let group = |layer: usize, prefix: &str| {
        let find = |letter: &str| names[layer].iter().position(|name| *name == format!("{prefix}{letter}"));
        Some(RgbChoice { layer, channels: [find("R")?, find("G")?, find("B")?] })
    };
    if let Some(choice) = (0..names.len()).find_map(|layer| group(layer, "")) {
        return Some(choice);
    }
    let prefixes = || {
        names.iter().enumerate().flat_map(|(layer, channels)| {
            channels.iter().filter_map(move |name| name.strip_suffix('R').map(|prefix| (layer, prefix)))
        })
    };
    let combined = prefixes().filter(|(_, prefix)| prefix.ends_with("Combined."));
    combined.chain(prefixes()).find_map(|(layer, prefix)| group(layer, prefix))
}

/// The layer with a lone channel, or with a luminance `Y`.
fn choose_grey(names: &[Vec<String>]) -> Option<usize> {
    let lone = || names.iter().position(|channels| channels.len() == 1);
    names.iter().position(|channels| channels.iter().any(|name| name == "Y")).or_else(lone)
}

/// All flat layers of a file: names and values of each channel.
struct Layers {
    names: Vec<Vec<String>>,
    image: openexr::FlatImage,
}

fn read_layers(source: &Source) -> Result<Layers> {
    let mut cursor = Cursor::new(source.bytes.as_slice());
    let outcome = guarded(&source.path, || {
        // On this thread only: a decoder that panics must do so where it is caught.
        Ok(openexr::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .non_parallel()
            .from_buffered(&mut cursor))
    })?;
    let image = outcome.map_err(|error| explain(error, &source.path, cursor.position()))?;
    let names = image
        .layer_data
        .iter()
        .map(|layer| layer.channel_data.list.iter().map(|channel| channel.name.to_string()).collect());
    Ok(Layers { names: names.collect(), image })
}

impl Layers {
    fn channel<'a>(&'a self, source: &Source, layer: usize, channel: usize) -> Result<&'a openexr::FlatSamples> {
        let layer = &self.image.layer_data[layer];
        let channel = &layer.channel_data.list[channel];
        if channel.sampling != openexr::Vec2(1, 1) || channel.sample_data.len() != layer.size.area() {
            return Err(unsupported(&source.path, format!("channel {} is stored at a lower resolution", channel.name)));
        }
        Ok(&channel.sample_data)
    }

    /// The colour of the file, or nothing when it has none.
    fn rgb(&self, source: &Source) -> Result<Option<RgbImage>> {
        let Some(choice) = choose_rgb(&self.names) else { return Ok(None) };
        let [red, green, blue] = choice.channels;
        let red = self.channel(source, choice.layer, red)?;
        let green = self.channel(source, choice.layer, green)?;
        let blue = self.channel(source, choice.layer, blue)?;
        let size = self.image.layer_data[choice.layer].size;
        let value = |index| Vec3::new(value_at(red, index), value_at(green, index), value_at(blue, index));
        Ok(Some(Image::from_pixels(size.width(), size.height(), (0..size.area()).map(value).collect())))
    }

    /// A lone channel or a luminance, or nothing when the file has none.
    fn grey(&self, source: &Source) -> Result<Option<GreyImage>> {
        let Some(layer) = choose_grey(&self.names) else { return Ok(None) };
        let channel = self.names[layer].iter().position(|name| name == "Y").unwrap_or(0);
        let samples = self.channel(source, layer, channel)?;
        if self.names[layer].iter().any(|name| name == "RY" || name == "BY") {
            return Err(unsupported(&source.path, "luminance with chroma is not read".into()));
        }
        let size = self.image.layer_data[layer].size;
        let pixels = (0..size.area()).map(|index| value_at(samples, index)).collect();
        Ok(Some(Image::from_pixels(size.width(), size.height(), pixels)))
    }

    fn nothing_fits(&self, source: &Source, wanted: &str) -> Error {
        let names: Vec<&str> = self.names.iter().flatten().take(12).map(String::as_str).collect();
        unsupported(&source.path, format!("the file holds no {wanted}; its channels are {}", names.join(", ")))
    }
}

fn value_at(samples: &openexr::FlatSamples, index: usize) -> f32 {
    match samples {
        openexr::FlatSamples::F16(values) => values[index].to_f32(),
        openexr::FlatSamples::F32(values) => values[index],
        openexr::FlatSamples::U32(values) => values[index] as f32,
    }
}

/// Colour as stored; a luminance is repeated.
pub fn read_rgb(source: &Source) -> Result<RgbImage> {
    let layers = read_layers(source)?;
    if let Some(image) = layers.rgb(source)? {
        return Ok(image);
    }
    match layers.grey(source)? {
        Some(image) => Ok(image.map(|&value| Vec3::splat(value))),
        None => Err(layers.nothing_fits(source, "colour (R G B)")),
    }
}

/// A lone channel as stored, else the luminance of the colour.
pub fn read_grey(source: &Source) -> Result<GreyImage> {
    let layers = read_layers(source)?;
    if let Some(image) = layers.grey(source)? {
        return Ok(image);
    }
    match layers.rgb(source)? {
        Some(image) => Ok(image.map(|&rgb| super::grey_of_rgb(rgb))),
        None => Err(layers.nothing_fits(source, "grey channel")),
    }
}

/// Writes `R G B` as floats: one part, scanlines, ZIP.
pub fn write_rgb(writer: &mut (impl Write + Seek), image: &RgbImage) -> std::io::Result<()> {
    let channel = |index: usize| image.pixels().iter().map(|rgb| rgb[index]).collect();
    let channels = vec![("B", channel(2)), ("G", channel(1)), ("R", channel(0))];
    write_channels(writer, image.width(), image.height(), channels)
}

/// Writes one channel `Y` as floats: one part, scanlines, ZIP.
pub fn write_grey(writer: &mut (impl Write + Seek), image: &GreyImage) -> std::io::Result<()> {
    write_channels(writer, image.width(), image.height(), vec![("Y", image.pixels().to_vec())])
}

fn write_channels(
    writer: &mut (impl Write + Seek),
    width: usize,
    height: usize,
    channels: Vec<(&str, Vec<f32>)>,
) -> std::io::Result<()> {
    if width == 0 || height == 0 {
        return Err(std::io::Error::other("an image without pixels"));
    }
    let encoding = openexr::Encoding {
        compression: openexr::Compression::ZIP16,
        blocks: openexr::Blocks::ScanLines,
        line_order: openexr::LineOrder::Increasing,
    };
    let channel = |(name, values)| openexr::AnyChannel::new(name, openexr::FlatSamples::F32(values));
    let channels = openexr::AnyChannels::sort(channels.into_iter().map(channel).collect());
    let layer = openexr::Layer::new((width, height), openexr::LayerAttributes::default(), encoding, channels);
    openexr::Image::from_layer(layer).write().to_buffered(writer).map_err(|error| match error {
        openexr::Error::Io(error) => error,
        other => std::io::Error::other(other.to_string()),
    })
}

fn unsupported(path: &Path, message: String) -> Error {
    Error::new(ErrorKind::Unsupported, message)
        .at(Place::File(path.into()))
        .remedy("save it as an RGB OpenEXR with ZIP compression")
}

fn explain(error: openexr::Error, path: &Path, byte: u64) -> Error {
    match error {
        openexr::Error::NotSupported(what) => unsupported(path, format!("this kind of OpenEXR is not read: {what}")),
        openexr::Error::Io(error) => Error::reading(path, error),
        other => malformed(path, byte, format!("the file breaks its format: {other}"))
            .remedy("the file is cut short or damaged: copy it again"),
    }
}
