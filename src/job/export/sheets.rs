//! What the files of each format are and what their numbers mean, as their sheets say it; and how the demo came out elsewhere.

use super::Format;
use crate::error::Result;
use crate::export::asset::Asset;
use crate::export::sheet::{self, Losses};
use crate::files::write_bytes;
use std::path::Path;

pub(super) const GLB_FILES: &str = "\
*.glb            mesh (+y up), material, textures, the sun as a directional light where the environment has one
  base colour    sRGB; diffuse reflectance over 1 - mean F, since glTF weighs diffuse light by 1 - max F
  metalness      blue of the second texture, no curve; used where the surface has metals (F0 above 0.16), else 0:
                 base colour is then F0 of what is metal, less what renderers add by light between microfacets
  roughness      square root of the GGX width; green of the second texture, no curve
  scale          of the node: a unit that was given (--unit-in-metres); all other formats and cameras.json are in units of the mesh
  F0             ((ior - 1) / (ior + 1))^2 times factor and texture (sRGB) of the specular colour: KHR_materials_ior,
                 KHR_materials_specular
  sun            colour times intensity = irradiance facing it, in the environment's radiance times steradian; Blender:
                 import with the lighting mode Unitless
environment.*    the whole light, linear; +x in the centre, as three.js and Blender look for it. Either this or the
                 sun with environment_without_sun.*: both together light the scene twice";
pub(super) const USD_FILES: &str = "\
*.usda, *.usdz   mesh, UsdPreviewSurface, dome light; the package holds the same
  workflow       variant set of the material: `metalness`, chosen at first, which every importer knows, or `specular`
base_color.png   metalness: diffuse reflectance over 1 - mean F, or F0 of what is metal, less what renderers add by light
                 between microfacets. This and other colours are in proportion (`raw`) with 16 bits and sRGB with 8, as the
                 stage says: between texels of sRGB some renderers interpolate along the curve, which is too dark
metallic.png     metalness, no curve; where there are metals
tint.png         metalness, times the scale that the stage says: by what F0 of the index of refraction, 1.3, is multiplied for
                 the fitted one; readers of the metalness workflow pass over it, Blender does not
diffuse.png      specular: diffuse reflectance as fitted
specular.png     specular: F0 as fitted
roughness.png    square root of the GGX width, no curve
metersPerUnit    a unit that was given (--unit-in-metres); coordinates are those of the mesh
environment.exr  the whole light, linear; left border -z, +z in the centre (OpenEXR's latitude-longitude)";
pub(super) const MITSUBA_FILES: &str = "\
scene.xml        sum of a diffuse BSDF and of `principled` as a metal, by blendbsdf of weight 0.9: diffuse_part.exr is
                 diffuse over 0.1, lobe_part.exr F0 over 0.9; roughness_ggx.exr (square root of the GGX width)
scene_exact.xml  the fitted model, BSDF `patina` of patina_lobe.py: diffuse.exr, specular.exr (F0), roughness.exr (a^2)
                 import mitsuba as mi; mi.set_variant(\"llvm_ad_rgb\"); import patina_lobe; mi.load_file(...)
environment_nodes.exr  the light on nodes, poles included: interpolated there it is the fitted one exactly
All maps are linear and read raw.";
pub(super) const BLENDER_FILES: &str = "\
import_patina.py builds mesh, material and world: blender --python import_patina.py
diffuse.exr, specular.exr  reflectances as fitted (F0), linear: a Diffuse BSDF plus a Principled BSDF that is all lobe
roughness.exr    square root of the GGX width
With `-- --one-shader` one Principled BSDF, of these maps:
base_color.exr   linear; diffuse reflectance over 1 - mean F, since Cycles takes from it what the lobe reflects
specular_tint.exr  linear; F0 over that of the index of refraction in material.json, specular level 0.5
metallic.exr     where the surface has metals (F0 above 0.16); base colour is F0 of what is metal
environment.exr  linear; +x in the centre";
pub(super) const MATERIALX_FILES: &str = "\
*.mtlx           open_pbr_surface over the maps, all linear
base_color.exr   diffuse reflectance over 1 - mean F, since the layers of OpenPBR take from it what the lobe reflects
specular_color.exr  F0 over that of specular_ior
specular_roughness.exr  square root of the GGX width
base_metalness.exr  where the surface has metals (F0 above 0.16); base colour is F0 of what is metal, less what
                 renderers add by light between microfacets
environment.exr  linear; left border -z, +z in the centre; mesh.obj with texture coordinates, v up";
pub(super) const TEXTURE_FILES: &str = "\
BaseColor, Metallic, Specular, Roughness   metalness workflow: F0 = (1 - metallic) 0.08 specular + metallic base colour,
                 diffuse = (1 - metallic) base colour
Diffuse, SpecularF0, Roughness             specular workflow, reflectances as fitted
Colours carry the sRGB curve in PNG and TIFF and are linear in EXR; Metallic, Specular, Roughness carry no curve.
Roughness is the square root of the GGX width. Texture coordinates of the OBJ point up: row 0 is v = 1.
environment.*    linear; left border -z, +z in the centre";

pub(super) const WEB_FILES: &str = "\
index.html       opens in browsers of 2023 and later, without a network; holds mesh, maps and environments
                 diffuse and F0 with the sRGB curve, microfacet width a = sqrt(r), eight bits each
                 drag turns, wheel zooms, Ctrl and drag moves, Shift and drag turns the light
                 index.html#light=1&rotation=90&exposure=0.5&backdrop=0&view=0&wipe=1 opens it so";

/// Writes the sheet of a format: its files, what they lose, and how the demo came out elsewhere where there is a lobe.
pub(super) fn write_sheet(
    format: Format,
    (title, files): (&str, &str),
    losses: &Losses,
    asset: &Asset,
    folder: &Path,
) -> Result<()> {
    let proof = proof_of(format).filter(|_| asset.has_lobe).map(sheet::of_proof).unwrap_or_default();
    write_bytes(&folder.join("convention.txt"), (sheet::of_format(title, files, losses) + &proof).as_bytes())
}

/// How far another program's picture of the demo was from the path tracer's: `patina-lab proof`, guide `export`. `None` where
/// nothing renders the format.
fn proof_of(format: Format) -> Option<&'static str> {
    Some(match format {
        Format::Glb => {
            "the demo in Cycles, imported by Blender 4.5: 2.9 and 2.6 % of the mean off under two lights (root mean square, \
             after one factor) where the lobe is GGX; what remains is the lobe laid over the diffuse part, which darkens it towards \
             grazing angles. `patina-lab proof RUN` measures another run"
        }
        Format::Usd => {
            "the demo in Cycles, imported by Blender 4.5: 2.9 and 2.6 % of the mean off under two lights (root mean square, after one factor) where \
             the lobe is GGX. `patina-lab proof RUN` measures another run"
        }
        Format::Mitsuba => {
            "the demo in Mitsuba 3.9 where the lobe is GGX: scene_exact.xml within noise; scene.xml at most 1.0 % of the mean off \
             under two lights (root mean square, after one factor). `patina-lab proof RUN` measures another run"
        }
        Format::Blender => {
            "the demo in Cycles, Blender 4.5: 0.6 and 0.4 % of the mean off under two lights (root mean square, after one factor) where \
             the lobe is GGX. `patina-lab proof RUN` measures another run"
        }
        Format::Web => {
            "the demo in Chromium: 6 and 16 % of the mean off under two lights, a statue 8 and 8 % (root mean square, after one \
             factor): what lobes reflect of other surface and shadows of lamps that are no sun. `patina-lab proof RUN` measures \
             another run"
        }
        Format::Materialx | Format::Textures => return None,
    })
}
