//! One HTML file that shows the result in any browser, with no network and no server.
//!
//! It holds the mesh, the maps and a few environments, already blurred by the fitted lobe for eight widths (split sum,
//! Karis 2013), and a small viewer for WebGL 2. The sun of an environment is taken out of it: it shines on the lobe itself
//! and casts shadows from sixteen places of its disc. What each vertex gets of the sky, past the mesh and by way of it, is baked
//! with rays, in spherical harmonics: soft shadows and light between surfaces follow the light as it turns. Sharp shadows of
//! other lamps are not shown, and the page says so.

mod prefilter;
mod transfer;

use super::asset::Asset;
use super::sun::sun_of;
use super::texture::{Curve, Texture};
use crate::error::{Error, ErrorKind, Result};
use crate::image::{Image, RgbImage};
use crate::light::Environment;
use crate::material::LobeModel;
use crate::scene::{Camera, Mesh};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::Vec3;
use serde_json::{Value, json};
use std::io::Write;

const PAGE: &str = include_str!("web/page.html");
/// The viewer: shaders, cameras, and what draws with them.
const VIEWER: &str = concat!(
    "\"use strict\";\n",
    include_str!("web/shaders.js"),
    include_str!("web/cameras.js"),
    include_str!("web/viewer.js")
);
/// What a page may hold beyond its maps, in bytes.
pub const LARGEST_BEYOND_MAPS: usize = 8_000_000;

/// A photograph to wipe against.
#[derive(Clone, Debug)]
pub struct PagePhoto {
    /// Name of the view.
    pub name: String,
    /// Where it was taken, at the size of the picture.
    pub camera: Camera,
    /// The picture as a JPEG file.
    pub jpeg: Vec<u8>,
}

/// A page and its parts in bytes.
pub struct Page {
    /// The file.
    pub html: String,
    /// Size of all but the maps, in bytes.
    pub beyond_maps: usize,
}

/// Makes the page. `lights` are shown in this order under their names.
///
/// # Errors
/// A mesh that rays cannot be traced in; maps without texels.
pub fn page(asset: &Asset, lights: &[(String, Environment)], photos: &[PagePhoto]) -> Result<Page> {
    let mesh = mesh_of(&asset.mesh, &asset.maps.diffuse)?;
    let roughness = asset.maps.roughness.map(|&r| r.max(0.0).sqrt());
    let maps = [
        Texture::Rgb(&asset.maps.diffuse).png(Curve::Srgb, false)?,
        Texture::Rgb(&asset.maps.specular).png(Curve::Srgb, false)?,
        // The microfacet width itself: its square would spend the steps of a byte badly.
        Texture::Grey(&roughness).png(Curve::Linear, false)?,
    ];
    let maps: Vec<String> = maps.iter().map(|png| format!("data:image/png;base64,{}", STANDARD.encode(png))).collect();
    let maps_bytes: usize = maps.iter().map(String::len).sum();
    let lights: Vec<Value> =
        lights.iter().map(|(name, light)| light_of(name, light, asset.lobe)).collect::<Result<_>>()?;
    let table = prefilter::reflectance_table(asset.lobe);
    let photos: Vec<Value> = photos.iter().map(photo_of).collect();
    let document = json!({
        "name": asset.name, "hasLobe": asset.has_lobe, "lobe": asset.lobe, "mesh": mesh, "maps": maps, "lights": lights,
        "table": {"size": prefilter::TABLE_SIDE, "values": halves(table.into_iter().flatten())?},
        "levels": prefilter::LEVELS, "photos": photos,
    });
    // No text of a file may end the script.
    let text = document.to_string().replace("</", "<\\/");
    let html = PAGE.replace("@TITLE@", &asset.name).replace("@VIEWER@", VIEWER).replace("@DOCUMENT@", &text);
    Ok(Page { beyond_maps: html.len() - maps_bytes, html })
}

/// Bytes as the viewer takes them in: deflated (RFC 1950), in base64.
fn packed(bytes: &[u8]) -> Result<Value> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let deflated = encoder.write_all(bytes).and_then(|()| encoder.finish());
    let deflated =
        deflated.map_err(|source| Error::new(ErrorKind::Internal, format!("the page cannot be packed: {source}")))?;
    Ok(json!({"deflated": STANDARD.encode(deflated)}))
}

/// Half floats.
fn halves(values: impl Iterator<Item = f32>) -> Result<Value> {
    packed(&values.flat_map(|value| half::f16::from_f32(value.min(65_000.0)).to_le_bytes()).collect::<Vec<u8>>())
}

fn words(values: impl Iterator<Item = u16>) -> Result<Value> {
    packed(&values.flat_map(u16::to_le_bytes).collect::<Vec<u8>>())
}

/// A share from -1 to 1 on 127 steps to each side.
fn byte(share: f32) -> u8 {
    (share.clamp(-1.0, 1.0) * 127.0).round() as i8 as u8
}

/// Positions on 65,536 steps of the bounding box, normals, openness and transfer on 127, coordinates on 65,536.
fn mesh_of(mesh: &Mesh, diffuse: &RgbImage) -> Result<Value> {
    let (low, high) = mesh.bounds().ok_or_else(|| {
        Error::new(ErrorKind::InvalidScene, "the mesh has no triangles")
            .remedy("make the run again with `patina fit SCENE -o RUN`")
    })?;
    let extent = (high - low).max(Vec3::splat(1e-9));
    let step = |share: f32| (share.clamp(0.0, 1.0) * 65_535.0 + 0.5) as u16;
    let positions = mesh.positions.iter().flat_map(|&p| ((p - low) / extent).to_array().map(step));
    let transfer = transfer::transfer(mesh, diffuse)?;
    let normals = mesh.normals.iter().zip(&transfer).flat_map(|(normal, own)| {
        let [x, y, z] = normal.to_array().map(byte);
        [x, y, z, byte(own.openness())]
    });
    // That of band 0 is the openness, which stands beside the normal.
    let direct = transfer.iter().flat_map(|own| own.direct.into_iter().skip(1));
    let between = transfer.iter().flat_map(|own| {
        let shares = own.between.into_iter().flatten().map(|value| byte(value / transfer::LARGEST_BETWEEN));
        shares.chain([byte(own.openness_behind)])
    });
    let uvs = mesh.uvs.iter().flat_map(|uv| [step(uv.x), step(uv.y)]);
    let indices: Vec<u8> = mesh.triangles.iter().flatten().flat_map(|index| index.to_le_bytes()).collect();
    Ok(json!({
        "low": low.to_array(), "extent": extent.to_array(), "positions": words(positions)?,
        "normals": packed(&normals.collect::<Vec<u8>>())?,
        "direct": packed(&direct.map(|value| byte(value / transfer::LARGEST)).collect::<Vec<u8>>())?,
        "between": packed(&between.collect::<Vec<u8>>())?, "uvs": words(uvs)?, "indices": packed(&indices)?,
        "largest": transfer::LARGEST, "largestBetween": transfer::LARGEST_BETWEEN,
    }))
}

/// A light as the viewer reads it; its sun is apart, since that casts shadows.
fn light_of(name: &str, light: &Environment, lobe: LobeModel) -> Result<Value> {
    let mean = crate::math::luminance(light.mean_radiance());
    let sun = sun_of(light);
    let light = sun.as_ref().map_or(light, |sun| &sun.rest);
    let levels = prefilter::levels(light, lobe);
    let pack = |image: &Image<Vec3>| halves(image.pixels().iter().flat_map(|rgb| [rgb.x, rgb.y, rgb.z, 1.0]));
    let levels: Vec<Value> = levels
        .iter()
        .map(|image| Ok(json!({"width": image.width(), "height": image.height(), "values": pack(image)?})))
        .collect::<Result<_>>()?;
    let irradiance = prefilter::irradiance(light);
    let harmonics: Vec<[f32; 3]> = transfer::coefficients(light).iter().map(|own| own.to_array()).collect();
    let sun = sun.as_ref().map(|sun| {
        // As a disc: solid angle 2 pi (1 - cos).
        let cosine = 1.0 - sun.solid_angle / std::f64::consts::TAU;
        json!({"towards": sun.towards.to_array(), "irradiance": sun.irradiance.to_array(), "cosine": cosine})
    });
    Ok(json!({
        "name": name, "levels": levels, "mean": mean, "sun": sun, "harmonics": harmonics,
        "irradiance": {"width": irradiance.width(), "height": irradiance.height(), "values": pack(&irradiance)?},
    }))
}

fn photo_of(photo: &PagePhoto) -> Value {
    let camera = &photo.camera;
    let rotation = camera.rotation_camera_from_world;
    json!({
        "name": photo.name, "width": camera.width, "height": camera.height,
        "focal": camera.focal_pixels.to_array(), "centre": camera.centre_pixels.to_array(),
        "rotation": rotation.to_cols_array(), "translation": camera.translation_camera_from_world.to_array(),
        "jpeg": format!("data:image/jpeg;base64,{}", STANDARD.encode(&photo.jpeg)),
    })
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::*;
    use flate2::read::ZlibDecoder;
    use std::io::Read;

    #[test]
    fn the_page_stands_alone() {
        let asset = small_asset(true);
        let light = asset.light.as_ref().unwrap().whole.clone();
        let page = page(&asset, &[("fitted </script> light".into(), light)], &[]).unwrap();
        assert!(page.html.starts_with("<!doctype html>"));
        for outside in ["http://", "https://", "src=\"/", "import(", "@VIEWER@", "@DOCUMENT@", "@TITLE@"] {
            assert!(!page.html.contains(outside), "{outside}");
        }
        assert_eq!(page.html.matches("</script>").count(), 2, "the document ends no script");
        assert!(page.beyond_maps < 1_000_000, "{}", page.beyond_maps);
        let data = page.html.split("<script type=\"application/json\" id=\"document\">").nth(1).unwrap();
        let data: Value = serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
        assert_eq!(data["lights"][0]["name"], "fitted </script> light");
        let bytes = |name: &str| {
            let deflated = STANDARD.decode(data["mesh"][name]["deflated"].as_str().unwrap()).unwrap();
            let mut bytes = Vec::new();
            ZlibDecoder::new(&deflated[..]).read_to_end(&mut bytes).unwrap();
            bytes
        };
        let vertices = asset.mesh.positions.len();
        assert_eq!(bytes("indices").len(), 4 * 6);
        assert_eq!([bytes("direct").len(), bytes("between").len()], [8 * vertices, 28 * vertices]);
        assert_eq!(data["lights"][0]["harmonics"].as_array().unwrap().len(), 9);
        // A flat square sees the whole sky, from both sides, and nothing of itself.
        assert_eq!(bytes("normals")[..4], [0, 0, 127, 127]);
        assert_eq!((bytes("between")[26], bytes("between")[27]), (0, 127));
    }
}
