//! The sheet of conventions that lies beside every set of maps.

/// First line of the sheet. A folder whose `convention.txt` starts with it is a run folder.
pub const FIRST_LINE: &str = "Patina run folder, format 1";

/// The whole sheet: what each file means, and how to convert it for other programs.
pub const SHEET: &str = "\
Patina run folder, format 1

What each number in this folder means. Copy this sheet along when you copy the maps.

FILES
  diffuse.exr    diffuse reflectance rho_d, linear RGB (Rec. 709 primaries), 0 to 1
  specular.exr   specular reflectance at normal incidence F0, linear RGB, 0 to 1; 0 everywhere: no lobe
  roughness.exr  roughness r = a^2, one value, 0 to 1, with a the microfacet width
  env.exr        the light, latitude-longitude, linear RGB radiance without upper bound
  mesh.obj       the surface with its atlas coordinates, in world units
  seen.exr       how many photographs saw a texel; 0: never seen, the maps there are filled in, not measured
  loss.csv       the loss of every step;  report.json, report.html  scores;  settings.toml  settings of the run
  capture.csv    how each photograph lies against the model's picture: shift, roll, gain, doubtful mask
  checkpoint     state to resume from
  earlier        the result that was here before, until a new fit has its own

FILES OF THE SOLVER
  diffuse_deviation.exr, specular_deviation.exr, roughness_deviation.exr
                 standard deviations of the maps, in their units; 1.645 of them either way hold nine tenths
  lobe_sharing.exr  number of texels that share a texel's lobe; 0 where no photograph shows the texel best
  choices.exr    what views that took no part chose: 1 no lobe, 2 one lobe a region, 3 lobes of their own, 0 not judged
  environment_evidence.exr  what a texel of the light is known by: highlights (red), background (green), diffuse light
                 and shadows (blue), as shares of 1; the rest is belief
  light_scale.json  relative deviation of the factor that light and reflectance have in common; null: left open

REFLECTION
  f = rho_d / pi + D F G / (4 (n.i)(n.o)),   without the cosine
  D  normalized Blinn-Phong,  D(h) = (e + 2) / (2 pi) (n.h)^e,   e = 2 / r - 2 = 2 / a^2 - 2
  F  Schlick,                 F0 + (1 - F0)(1 - h.o)^5
  G  Smith with Schlick-GGX,  G1(c) = c / (c (1 - k) + k),   k = a / 2
  The diffuse part is not reduced by F.
  Where settings.toml says lobe = \"ggx\":
  D  GGX,                     D(h) = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2)
  G  Smith, height-correlated,  G / (4 i o) = 1 / (2 (i R(o) + o R(i))),  i = n.i,  o = n.o,
                              R(c)^2 = a^2 + (1 - a^2) c^2

ROUGHNESS IN OTHER PROGRAMS
  width a of Beckmann or GGX                      a = sqrt(r)
  roughness of glTF, Disney, Blender, Unreal      sqrt(a) = r^(1/4)
  Blinn-Phong exponent                            2 / r - 2
  redner                                          r, as it is
  GGX has longer tails than Blinn-Phong: at equal width a highlight looks a little different. `patina export` converts.

REFLECTANCE IN OTHER PROGRAMS
  glTF base colour = diffuse, metallic 0; F0 through KHR_materials_specular (a dielectric's default F0 is 0.04).
  glTF weighs the diffuse part by 1 - max F, this model does not: a shiny surface comes out a little darker there.

SCALE
  Reflectance times c with light divided by c leaves every photograph unchanged, channel by channel. Which c was chosen
  is written in report.json (gauge_statement). Only ratios within a channel are measured, unless a reference was given.

COLOUR
  EXR files are linear. For 8-bit textures encode diffuse and specular with the sRGB curve, roughness without a curve.

AXES
  World: right-handed, +y up, lengths in the units of the mesh.
  Texture: texel (row r, column c) of a W x H map is centred at u = (c + 0.5) / W, v = 1 - (r + 0.5) / H.
  Light: row 0 is straight up; theta = acos(d.y), phi = atan2(d.x, -d.z) mod 2 pi grows with the columns;
  d points from the surface towards the light. The left border looks along -z, a quarter of the width along +x.
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sheet_starts_with_its_mark_and_fits_a_terminal() {
        assert!(SHEET.starts_with(FIRST_LINE));
        assert!(SHEET.lines().all(|line| line.chars().count() <= 120));
        for word in super::super::run_folder::earlier::files_of_a_run() {
            assert!(SHEET.contains(word), "{word}");
        }
        for word in ["roughness.exr", "sqrt(a) = r^(1/4)", "linear", "+y up", "SCALE"] {
            assert!(SHEET.contains(word), "{word}");
        }
    }
}
