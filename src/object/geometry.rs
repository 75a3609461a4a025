//! What each pixel sees: a normal, the direction to the eye, and which texels of the environment light it.

use crate::error::{Error, ErrorKind, Result};
use crate::image::Image;
use crate::math::{parallel, sphere};
use crate::scene::{Camera, Mesh};
use crate::trace::{Bvh, Ray};
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// Pixels that see the surface more obliquely than this cosine are left out: models and meshes are worst there.
pub const LEAST_EYE_COSINE: f32 = 0.08;
/// Pixels a task; results do not depend on it.
const CHUNK: usize = 64;

/// What one pixel sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectPixel {
    /// Row in the photo.
    pub row: u32,
    /// Column in the photo.
    pub column: u32,
    /// Unit shading normal in the world.
    pub normal: Vec3,
    /// Unit direction to the eye in the world.
    pub to_eye: Vec3,
    /// Where shadow rays start, in the world; only with a mesh.
    pub origin: Vec3,
    /// Unit geometric normal on the side of the eye.
    pub geometric_normal: Vec3,
}

impl ObjectPixel {
    /// Whether it sees the surface steeply enough for a fit.
    fn is_for_fits(&self) -> bool {
        self.normal.dot(self.to_eye) >= LEAST_EYE_COSINE
    }
}

/// The pixels of one photo that show the object, and the mesh that shadows them.
#[derive(Clone, Debug)]
pub struct ObjectGeometry {
    /// Width of the photo in pixels.
    pub width: usize,
    /// Height of the photo in pixels.
    pub height: usize,
    /// The pixels, in row-major order.
    pub pixels: Vec<ObjectPixel>,
    /// Pixels that see the surface more obliquely than [`LEAST_EYE_COSINE`]: no fit uses them, pictures show them.
    pub grazing: Vec<ObjectPixel>,
    /// The mesh for shadow rays; `None` for a convex object, which shadows nothing but its own back.
    pub bvh: Option<Arc<Bvh>>,
}

impl ObjectGeometry {
    /// A sphere seen from infinitely far along -z, with +y up: the set-up of the paper's experiments.
    ///
    /// The centre lies in the middle of the photo; `radius_pixels` is usually half its shorter side.
    pub fn sphere(width: usize, height: usize, radius_pixels: f32) -> Self {
        Self::sphere_at(width, height, Vec2::new(0.5 * width as f32, 0.5 * height as f32), radius_pixels)
    }

    /// [`ObjectGeometry::sphere`] with its centre anywhere, in pixels from the upper left corner.
    pub fn sphere_at(width: usize, height: usize, centre: Vec2, radius_pixels: f32) -> Self {
        let mut pixels = Vec::new();
        for row in 0..height {
            for column in 0..width {
                let place = (Vec2::new(column as f32 + 0.5, row as f32 + 0.5) - centre) / radius_pixels;
                let squared = place.length_squared();
                if squared >= 1.0 {
                    continue;
                }
                let normal = Vec3::new(place.x, -place.y, (1.0 - squared).sqrt());
                let (row, column) = (row as u32, column as u32);
                let to_eye = Vec3::Z;
                pixels.push(ObjectPixel { row, column, normal, to_eye, origin: normal, geometric_normal: normal });
            }
        }
        Self::of_pixels(width, height, pixels, None)
    }

    /// The pixels of a camera whose centre and four corners all meet the mesh: a pixel across the outline mixes.
    ///
    /// # Errors
    /// Those of [`Mesh::validate`], [`Camera::validate`] and [`Bvh::build`].
    pub fn of_mesh(mesh: &Mesh, camera: &Camera) -> Result<Self> {
        mesh.validate()?;
        camera.validate(1e-2)?;
        let bvh = Arc::new(Bvh::build(&mesh.positions, &mesh.triangles)?);
        Ok(Self::of_mesh_with(mesh, bvh, camera))
    }

    /// [`ObjectGeometry::of_mesh`] with the hierarchy at hand; mesh and camera are valid.
    pub fn of_mesh_with(mesh: &Mesh, bvh: Arc<Bvh>, camera: &Camera) -> Self {
        let with_normals;
        let mesh = if mesh.normals.len() == mesh.positions.len() {
            mesh
        } else {
            with_normals = {
                let mut copy = mesh.clone();
                copy.compute_normals();
                copy
            };
            &with_normals
        };
        let rows: Vec<Vec<ObjectPixel>> = parallel::map(camera.height, |row| {
            (0..camera.width).filter_map(|column| seen(mesh, &bvh, camera, row, column)).collect()
        });
        Self::of_pixels(camera.width, camera.height, rows.concat(), Some(bvh))
    }

    /// Keeps apart what is seen too obliquely.
    fn of_pixels(width: usize, height: usize, pixels: Vec<ObjectPixel>, bvh: Option<Arc<Bvh>>) -> Self {
        let (pixels, grazing) = pixels.into_iter().partition(ObjectPixel::is_for_fits);
        ObjectGeometry { width, height, pixels, grazing, bvh }
    }

    /// The same with the pixels that no fit uses among the others: for pictures, which would be black there.
    pub fn with_grazing(&self) -> Self {
        let mut pixels = [self.pixels.as_slice(), &self.grazing].concat();
        pixels.sort_by_key(|pixel| (pixel.row, pixel.column));
        ObjectGeometry { pixels, grazing: Vec::new(), ..self.clone() }
    }

    /// Pixels of given normals (unit length or zero for none, in the world), all seen along one direction.
    ///
    /// # Errors
    /// `NonFinite` when a normal is not finite.
    pub fn of_normals(normals: &Image<Vec3>, to_eye: Vec3) -> Result<Self> {
        let to_eye = to_eye.try_normalize().unwrap_or(Vec3::Z);
        let mut pixels = Vec::new();
        for row in 0..normals.height() {
            for column in 0..normals.width() {
                let normal = normals[(row, column)];
                if !normal.is_finite() {
                    let message = format!("the normal at row {row} column {column} is not finite");
                    return Err(Error::new(ErrorKind::NonFinite, message).remedy("export the normals again"));
                }
                let Some(normal) = normal.try_normalize() else { continue };
                if normal.dot(to_eye) > 0.0 {
                    let (row, column) = (row as u32, column as u32);
                    pixels.push(ObjectPixel { row, column, normal, to_eye, origin: normal, geometric_normal: normal });
                }
            }
        }
        Ok(Self::of_pixels(normals.width(), normals.height(), pixels, None))
    }

    /// Which texels of a `width x height` environment are seen from each of `pixels`; `None` when nothing shadows.
    pub fn visibility(&self, pixels: &[ObjectPixel], width: usize, height: usize) -> Option<Visibility> {
        let bvh = self.bvh.as_ref()?;
        let directions: Vec<Vec3> = (0..width * height)
            .map(|texel| sphere::direction_of_texel(texel / width, texel % width, width, height))
            .collect();
        let words = directions.len().div_ceil(64);
        let mut bits = vec![0u64; words * pixels.len()];
        parallel::each_chunk(&mut bits, words * CHUNK, &|chunk, bits| {
            for (bits, pixel) in bits.chunks_mut(words).zip(&pixels[chunk * CHUNK..]) {
                for (texel, &direction) in directions.iter().enumerate() {
                    if pixel.normal.dot(direction) <= 0.0 || pixel.geometric_normal.dot(direction) <= 0.0 {
                        continue;
                    }
                    let origin = bvh.offset_origin(pixel.origin, pixel.geometric_normal, direction);
                    if !bvh.is_occluded(&Ray { origin, direction, t_max: f32::INFINITY }) {
                        bits[texel / 64] |= 1 << (texel % 64);
                    }
                }
            }
        });
        Some(Visibility { words, bits })
    }
}

fn seen(mesh: &Mesh, bvh: &Bvh, camera: &Camera, row: usize, column: usize) -> Option<ObjectPixel> {
    let corner = Vec2::new(column as f32, row as f32);
    let ray = camera.ray_through(corner + Vec2::splat(0.5));
    let hit = bvh.closest_hit(&ray)?;
    for offset in [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE] {
        bvh.closest_hit(&camera.ray_through(corner + offset))?;
    }
    let triangle = mesh.triangles[hit.triangle as usize].map(|vertex| vertex as usize);
    let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
    let blend = |values: &[Vec3]| (0..3).map(|corner| values[triangle[corner]] * weights[corner]).sum::<Vec3>();
    let to_eye = -ray.direction;
    let facing = |normal: Vec3| if normal.dot(to_eye) < 0.0 { -normal } else { normal };
    let geometric_normal = facing(mesh.area_vector(hit.triangle as usize).try_normalize()?);
    let shading = blend(&mesh.normals).try_normalize().unwrap_or(geometric_normal);
    let normal = if shading.dot(geometric_normal) < 0.0 { -shading } else { shading };
    Some(ObjectPixel {
        row: row as u32,
        column: column as u32,
        normal: towards(normal, to_eye),
        to_eye,
        origin: blend(&mesh.positions),
        geometric_normal,
    })
}

/// A shading normal that turns away from the eye, at the rim of a smoothed mesh, is bent back until it just faces it: a
/// pixel that is seen has a picture.
fn towards(normal: Vec3, to_eye: Vec3) -> Vec3 {
    const JUST_FACING: f32 = 0.01;
    match JUST_FACING - normal.dot(to_eye) {
        short if short > 0.0 => (normal + short * to_eye).normalize_or(to_eye),
        _ => normal,
    }
}

/// One bit a pixel and texel: whether light arrives.
#[derive(Clone, Debug, PartialEq)]
pub struct Visibility {
    words: usize,
    bits: Vec<u64>,
}

impl Visibility {
    /// Whether light from a texel arrives at a pixel, both by their index at making.
    #[inline]
    pub fn is_visible(&self, pixel: usize, texel: usize) -> bool {
        self.bits[pixel * self.words + texel / 64] >> (texel % 64) & 1 == 1
    }

    /// The rows of some pixels, in their order.
    pub fn of(&self, pixels: &[usize]) -> Self {
        let rows = pixels.iter().flat_map(|&pixel| &self.bits[pixel * self.words..(pixel + 1) * self.words]);
        Visibility { words: self.words, bits: rows.copied().collect() }
    }

    /// Joins the rows of several photos of the same environment size.
    pub fn joined(parts: Vec<Visibility>) -> Option<Self> {
        let words = parts.first()?.words;
        Some(Visibility { words, bits: parts.into_iter().flat_map(|part| part.bits).collect() })
    }

    /// All texels seen from all pixels: for photos without a mesh beside photos with one.
    pub fn open(pixels: usize, texels: usize) -> Self {
        let words = texels.div_ceil(64);
        Visibility { words, bits: vec![u64::MAX; words * pixels] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A floor of two triangles and a wall at x = 1 that hides the light from +x.
    fn corner() -> Mesh {
        let positions = vec![
            Vec3::new(-4.0, 0.0, -4.0),
            Vec3::new(1.0, 0.0, -4.0),
            Vec3::new(1.0, 0.0, 4.0),
            Vec3::new(-4.0, 0.0, 4.0),
            Vec3::new(1.0, 50.0, -4.0),
            Vec3::new(1.0, 50.0, 4.0),
            Vec3::new(1.0, 0.0, -4.0),
            Vec3::new(1.0, 0.0, 4.0),
        ];
        Mesh { positions, triangles: vec![[0, 2, 1], [0, 3, 2], [6, 7, 5], [6, 5, 4]], ..Default::default() }
    }

    #[test]
    fn a_wall_hides_the_light_behind_it_and_nothing_else() {
        let mesh = corner();
        let camera = Camera::looking_at(Vec3::new(-1.0, 6.0, 0.0), Vec3::new(-0.9, 0.0, 0.0), 9, 9, 0.2);
        let geometry = ObjectGeometry::of_mesh(&mesh, &camera).unwrap();
        assert_eq!(geometry.pixels.len(), 81);
        assert!(geometry.pixels.iter().all(|pixel| pixel.normal.y > 0.99 && pixel.to_eye.y > 0.9));
        let (width, height) = (32, 16);
        let visibility = geometry.visibility(&geometry.pixels, width, height).unwrap();
        let mut counts = [0, 0];
        for texel in 0..width * height {
            let direction = sphere::direction_of_texel(texel / width, texel % width, width, height);
            if direction.y <= 0.0 {
                assert!(!visibility.is_visible(40, texel));
                continue;
            }
            // The wall spans z in -4..4 and rises to 50 at distance 2.
            let expected = {
                let t = (1.0 - geometry.pixels[40].origin.x) / direction.x;
                let hit = geometry.pixels[40].origin + t * direction;
                !(direction.x > 0.0 && hit.z.abs() < 4.0 && hit.y < 50.0)
            };
            assert_eq!(visibility.is_visible(40, texel), expected, "{direction}");
            counts[usize::from(expected)] += 1;
        }
        assert!(counts[0] > 20 && counts[1] > 100, "{counts:?}");
    }

    #[test]
    fn grazing_pixels_are_kept_from_fits_and_shown_in_pictures() {
        let sphere = ObjectGeometry::sphere_at(80, 64, Vec2::new(45.0, 30.0), 25.0);
        assert!(!sphere.grazing.is_empty());
        let whole = sphere.with_grazing();
        assert_eq!(whole.pixels.len(), sphere.pixels.len() + sphere.grazing.len());
        assert!(whole.pixels.windows(2).all(|pair| (pair[0].row, pair[0].column) < (pair[1].row, pair[1].column)));
        let inside = |pixel: &ObjectPixel| {
            Vec2::new(pixel.column as f32 + 0.5 - 45.0, pixel.row as f32 + 0.5 - 30.0).length() < 25.0
        };
        assert!(whole.pixels.iter().all(inside));
        // A floor seen at four degrees: no fit may use it, and no picture of it is black.
        let floor = Mesh {
            positions: vec![
                Vec3::new(-40.0, 0.0, -40.0),
                Vec3::new(40.0, 0.0, -40.0),
                Vec3::new(40.0, 0.0, 40.0),
                Vec3::new(-40.0, 0.0, 40.0),
            ],
            triangles: vec![[0, 2, 1], [0, 3, 2]],
            ..Default::default()
        };
        let camera = Camera::looking_at(Vec3::new(0.0, 0.7, 10.0), Vec3::ZERO, 9, 9, 0.02);
        let geometry = ObjectGeometry::of_mesh(&floor, &camera).unwrap();
        assert_eq!((geometry.pixels.len(), geometry.grazing.len()), (0, 81));
        // A shading normal beyond the rim is bent until it faces the eye.
        let bent = towards(Vec3::new(0.99, 0.0, -0.14).normalize(), Vec3::Z);
        assert!(bent.z > 0.0 && bent.z < LEAST_EYE_COSINE && (bent.length() - 1.0).abs() < 1e-5, "{bent}");
    }

    #[test]
    fn a_sphere_shows_its_front_with_up_at_the_top() {
        let geometry = ObjectGeometry::sphere(64, 64, 32.0);
        assert!(geometry.bvh.is_none());
        let share = geometry.pixels.len() as f32 / 4096.0;
        assert!((share - std::f32::consts::FRAC_PI_4).abs() < 0.02, "{share}");
        let first = geometry.pixels[0];
        assert!(first.normal.y > 0.9 && first.row < 3);
        assert!(geometry.pixels.iter().all(|pixel| (pixel.normal.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn normals_of_a_sphere_give_the_pixels_of_the_sphere_and_bad_ones_are_named() {
        let sphere = ObjectGeometry::sphere(24, 20, 10.0);
        let mut normals = Image::filled(24, 20, Vec3::ZERO);
        for pixel in &sphere.pixels {
            normals[(pixel.row as usize, pixel.column as usize)] = pixel.normal;
        }
        let given = ObjectGeometry::of_normals(&normals, Vec3::Z).unwrap();
        assert_eq!((given.width, given.height, given.pixels.len()), (24, 20, sphere.pixels.len()));
        for (own, other) in given.pixels.iter().zip(&sphere.pixels) {
            assert_eq!((own.row, own.column, own.to_eye), (other.row, other.column, other.to_eye));
            assert!(own.normal.distance(other.normal) < 1e-6);
        }
        normals[(3, 4)] = Vec3::NAN;
        let error = ObjectGeometry::of_normals(&normals, Vec3::Z).err().unwrap();
        assert_eq!(error.kind(), ErrorKind::NonFinite);
        assert!(error.to_string().contains("row 3 column 4"), "{error}");
    }
}
