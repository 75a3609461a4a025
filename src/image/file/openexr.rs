//! OpenEXR: any flat layer with half, float or integer channels is read; scanline ZIP with floats is written.
//!
//! Which layer is the picture is decided by [`super::exr_layers`]. The image is the display window: pixels of the data window
//! outside it are cut, pixels that the file does not hold are not seen. Primaries other than those of Rec. 709 are converted.
//! For grey, `Y` is taken first, then a lone channel of any name, then the luminance of the colour. Levels of detail and deep
//! pixels are left out; luminance with chroma is refused.

use super::colour::{Primaries, is_identity};
use super::exr_layers::{self, Layer, Part, Placed};
use super::format::{Source, implausible, malformed, too_large};
use super::guard::guarded;
use super::photo::{PhotoFile, PhotoPixels};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::{GreyImage, Image, RgbImage};
use exr::prelude as openexr;
use exr::prelude::{ReadChannels, ReadLayers, WritableImage};
use glam::{DMat3, DVec2, Vec3};
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
        if pixels > super::format::LARGEST_PIXEL_COUNT {
            return Err(too_large(path, format!("the file claims {width} x {height} pixels")));
        }
        let sample_bytes: usize =
            header.channels.list.iter().map(|channel| channel.sample_type.bytes_per_sample()).sum();
        let bytes = pixels.saturating_mul(sample_bytes as u64);
        let ratio = match header.compression {
            openexr::Compression::Uncompressed => 1,
            openexr::Compression::ZIP1 | openexr::Compression::ZIP16 | openexr::Compression::RLE => BEST_DEFLATE_RATIO,
            // Huffman codes with runs, and cosine transforms under deflate.
            _ => 4 * BEST_DEFLATE_RATIO,
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
    if headers.iter().all(|header| header.deep) {
        return Err(unsupported(path, "deep pixels are not read".into()));
    }
    // The display window is one for all parts.
    let Some(header) = headers.iter().find(|header| !header.deep) else {
        return Err(malformed(path, byte, "the file holds no picture").remedy("export it again"));
    };
    let window = header.shared_attributes.display_window.size;
    let (width, height) = (window.width(), window.height());
    if (width as u64).saturating_mul(height as u64) > super::format::LARGEST_PIXEL_COUNT {
        return Err(too_large(path, format!("the file claims {width} x {height} pixels")));
    }
    let largest = headers.iter().filter(|header| !header.deep).max_by_key(|header| header.layer_size.area());
    if let Some(header) = largest {
        let stored = (header.layer_size.width(), header.layer_size.height());
        Placed { size: (width, height), offset: (0, 0), stored }.check(path)?;
    }
    Ok((width, height))
}

/// All flat parts of a file: their names and the values of each channel.
struct File {
    parts: Vec<Part>,
    image: openexr::FlatImage,
}

fn read_file(source: &Source) -> Result<File> {
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
    let part = |layer: &openexr::Layer<openexr::AnyChannels<openexr::FlatSamples>>| Part {
        name: layer.attributes.layer_name.as_ref().map(|name| name.to_string()).unwrap_or_default(),
        channels: layer.channel_data.list.iter().map(|channel| channel.name.to_string()).collect(),
    };
    Ok(File { parts: image.layer_data.iter().map(part).collect(), image })
}

impl File {
    fn channel<'a>(&'a self, source: &Source, part: usize, channel: usize) -> Result<&'a openexr::FlatSamples> {
        let part = &self.image.layer_data[part];
        let channel = &part.channel_data.list[channel];
        if channel.sampling != openexr::Vec2(1, 1) || channel.sample_data.len() != part.size.area() {
            return Err(unsupported(&source.path, format!("channel {} is stored at a lower resolution", channel.name)));
        }
        Ok(&channel.sample_data)
    }

    /// Where the pixels of a part lie in the picture.
    fn placed(&self, source: &Source, part: usize) -> Result<Placed> {
        let window = self.image.attributes.display_window;
        let part = &self.image.layer_data[part];
        let position = part.attributes.layer_position;
        let offset = |part: i32, window: i32| i64::from(part) - i64::from(window);
        let placed = Placed {
            size: (source.header.width, source.header.height),
            offset: (offset(position.x(), window.position.x()), offset(position.y(), window.position.y())),
            stored: (part.size.width(), part.size.height()),
        };
        placed.check(&source.path)?;
        Ok(placed)
    }

    /// The picture of a layer in its primaries, and whether its opacity and its windows say that pixels are missing.
    fn photo(&self, source: &Source, layer: &Layer) -> Result<PhotoFile> {
        let [red, green, blue] = layer.channels;
        let red = self.channel(source, layer.part, red)?;
        let green = self.channel(source, layer.part, green)?;
        let blue = self.channel(source, layer.part, blue)?;
        let alpha = layer.alpha.map(|alpha| self.channel(source, layer.part, alpha)).transpose()?;
        let placed = self.placed(source, layer.part)?;
        let mut findings: Vec<Finding> = placed.told().into_iter().collect();
        let matrix = self.rec709_from_stored();
        if matrix.is_some() {
            let message = "colours are converted from the primaries of the file to Rec. 709";
            findings.push(Finding::new(Severity::Note, "colour-converted", message));
        }
        let matrix = matrix.map(|matrix| matrix.as_mat3());
        let value = |index| {
            let stored = Vec3::new(value_at(red, index), value_at(green, index), value_at(blue, index));
            matrix.map_or(stored, |matrix| matrix * stored)
        };
        Ok(PhotoFile {
            pixels: PhotoPixels::Linear(spread(&placed, Vec3::ZERO, value)),
            alpha: alpha.map(|alpha| spread(&placed, 0.0, |index| value_at(alpha, index))),
            is_inside: (!placed.is_whole()).then(|| spread(&placed, false, |_| true)),
            findings,
            ..PhotoFile::default()
        })
    }

    /// The matrix to linear Rec. 709, where the file declares other primaries.
    fn rec709_from_stored(&self) -> Option<DMat3> {
        let declared = self.image.attributes.chromaticities?;
        let xy = |place: openexr::Vec2<f32>| DVec2::new(f64::from(place.0), f64::from(place.1));
        let primaries = Primaries {
            red: xy(declared.red),
            green: xy(declared.green),
            blue: xy(declared.blue),
            white: xy(declared.white),
        };
        primaries.rec709_from_rgb().filter(|matrix| !is_identity(matrix))
    }

    /// A lone channel or a luminance, with its opacity, or nothing when the file has none.
    fn grey(&self, source: &Source) -> Result<Option<(GreyImage, Option<GreyImage>)>> {
        let names = |part: usize| self.parts[part].channels.iter();
        let lone = || (0..self.parts.len()).find(|&part| names(part).count() == 1);
        let luminance = (0..self.parts.len()).find(|&part| names(part).any(|name| name == "Y"));
        let Some(part) = luminance.or_else(lone) else { return Ok(None) };
        let channel = names(part).position(|name| name == "Y").unwrap_or(0);
        let samples = self.channel(source, part, channel)?;
        if names(part).any(|name| name == "RY" || name == "BY") {
            return Err(unsupported(&source.path, "luminance with chroma is not read".into()));
        }
        if ["X", "Z"].iter().all(|wanted| names(part).any(|name| name == wanted)) {
            return Err(unsupported(&source.path, "CIE XYZ colours are not read".into()));
        }
        let placed = self.placed(source, part)?;
        let image = |samples| spread(&placed, 0.0, |index| value_at(samples, index));
        let opacity = names(part).position(|name| name == "A").filter(|&own| own != channel);
        let opacity = opacity.map(|own| self.channel(source, part, own)).transpose()?;
        Ok(Some((image(samples), opacity.map(image))))
    }

    fn nothing_fits(&self, source: &Source, wanted: &str) -> Error {
        let names: Vec<&str> = self.parts.iter().flat_map(|part| &part.channels).take(12).map(String::as_str).collect();
        unsupported(&source.path, format!("the file holds no {wanted}; its channels are {}", names.join(", ")))
    }
}

/// The picture of a data window; `outside` where nothing is stored.
fn spread<T: Clone>(placed: &Placed, outside: T, value: impl Fn(usize) -> T) -> Image<T> {
    if placed.is_whole() {
        return Image::from_pixels(
            placed.size.0,
            placed.size.1,
            (0..placed.size.0 * placed.size.1).map(value).collect(),
        );
    }
    Image::from_fn(placed.size.0, placed.size.1, |row, column| {
        placed.stored_index(row, column).map_or_else(|| outside.clone(), &value)
    })
}

fn value_at(samples: &openexr::FlatSamples, index: usize) -> f32 {
    match samples {
        openexr::FlatSamples::F16(values) => values[index].to_f32(),
        openexr::FlatSamples::F32(values) => values[index],
        openexr::FlatSamples::U32(values) => values[index] as f32,
    }
}

/// The layer of this name, or the one of radiance; a luminance is repeated where there is no colour.
pub fn read_photo(source: &Source, layer: Option<&str>) -> Result<PhotoFile> {
    let file = read_file(source)?;
    let layers = exr_layers::layers_of(&file.parts);
    if let Some(chosen) = exr_layers::choose(&layers, layer, &source.path)? {
        let mut photo = file.photo(source, chosen)?;
        photo.findings.extend(exr_layers::told(&layers, chosen));
        return Ok(photo);
    }
    let names: Vec<&str> = file.parts.iter().flat_map(|part| part.channels.iter().map(AsRef::as_ref)).collect();
    if !names.is_empty() && names.iter().all(|name| is_no_light(name)) {
        return Err(file.nothing_fits(source, "colour (R G B)"));
    }
    match file.grey(source)? {
        Some((image, alpha)) => {
            let pixels = PhotoPixels::Linear(image.map(|&value| Vec3::splat(value)));
            Ok(PhotoFile { pixels, alpha, ..PhotoFile::default() })
        }
        None => Err(file.nothing_fits(source, "colour (R G B)")),
    }
}

/// Whether a channel by its name holds distances, opacity or numbers of things, which a map may be made of and a photo not.
fn is_no_light(channel: &str) -> bool {
    let own = channel.rsplit('.').next().unwrap_or(channel);
    ["z", "zback", "depth", "distance", "id", "mask", "a", "alpha"].iter().any(|other| own.eq_ignore_ascii_case(other))
}

/// A lone channel as stored, else the luminance of the colour.
pub fn read_grey(source: &Source) -> Result<GreyImage> {
    let file = read_file(source)?;
    if let Some((image, _)) = file.grey(source)? {
        return Ok(image);
    }
    let layers = exr_layers::layers_of(&file.parts);
    match exr_layers::choose(&layers, None, &source.path)? {
        Some(layer) => Ok(file.photo(source, layer)?.into_linear().map(|&rgb| super::grey_of_rgb(rgb))),
        None => Err(file.nothing_fits(source, "grey channel")),
    }
}

/// Writes `R G B` as floats: one part, scanlines, ZIP.
pub fn write_rgb(writer: &mut (impl Write + Seek), image: &RgbImage) -> std::io::Result<()> {
    let channel = |index: usize| image.pixels().iter().map(|rgb| rgb[index]).collect();
    let channels = vec![("B", channel(2)), ("G", channel(1)), ("R", channel(0))];
    write_channels(writer, image.width(), image.height(), channels)
}

/// Writes `R G B A` as floats: one part, scanlines, ZIP.
pub fn write_rgba(writer: &mut (impl Write + Seek), image: &RgbImage, alpha: &GreyImage) -> std::io::Result<()> {
    let channel = |index: usize| image.pixels().iter().map(|rgb| rgb[index]).collect();
    let channels = vec![("A", alpha.pixels().to_vec()), ("B", channel(2)), ("G", channel(1)), ("R", channel(0))];
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
