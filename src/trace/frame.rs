//! A query in AVX2 vectors.
//!
//! It is made from the ray itself and not from a [`Query`], because numbers that are stored one by one cannot be loaded
//! as a vector until they have reached the cache; for camera rays that wait was a quarter of the time.

use super::Ray;
use super::query::{self, Query};
use std::arch::x86_64::*;

/// A [`Query`] in vectors; each number is spread over all lanes.
pub(super) struct Frame {
    /// Where in a node the planes lie through which the ray enters, in bytes, axis by axis.
    pub entry_plane: [usize; 3],
    /// Where in a node the planes lie through which the ray leaves.
    pub exit_plane: [usize; 3],
    /// See [`Query::inverse`].
    pub inverse: [__m256; 3],
    /// See [`Query::entry_offset`].
    pub entry_offset: [__m256; 3],
    /// See [`Query::exit_offset`].
    pub exit_offset: [__m256; 3],
    /// Where in a block the points' coordinates lie, in bytes, in the order of [`Query::axes`].
    pub points: [usize; 3],
    /// The origin in that order.
    pub origin: [__m256; 3],
    /// See [`Query::shear`].
    pub shear: [__m256; 3],
}

/// Bytes of a row of eight numbers, in a node and in a block.
const ROW: usize = 32;
/// Components of a direction between this and its inverse take the short way.
const SMALL: f32 = 1.0 / (1 << 20) as f32;
/// [`Query::axes`] by the axis of the direction's largest component.
static AXES: [[i32; 4]; 3] = [[1, 2, 0, 3], [2, 0, 1, 3], [0, 1, 2, 3]];
/// The same in bytes.
static AXIS_ROWS: [[usize; 3]; 3] = [[ROW, 2 * ROW, 0], [2 * ROW, 0, ROW], [0, ROW, 2 * ROW]];

// A ray is read as seven numbers.
const _: () = assert!(size_of::<Ray>() == 7 * size_of::<f32>() && std::mem::offset_of!(Ray, direction) == 12);

impl Frame {
    /// See [`Query::new`]; the numbers are the same bits.
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    pub fn new(ray: &Ray, largest_coordinate: f32) -> Option<Frame> {
        // SAFETY: a ray is seven numbers on end: origin, direction, end. The fourth lanes are not used.
        let (origin, direction) = unsafe {
            let numbers = std::ptr::from_ref(ray).cast::<f32>();
            (_mm_loadu_ps(numbers), _mm_loadu_ps(numbers.add(3)))
        };
        let sign = _mm_set1_ps(-0.0);
        let size = _mm_andnot_ps(sign, direction);
        // Rays of ordinary numbers need none of the care that `Query::new` takes; a NaN is not ordinary.
        let is_ordinary = _mm_and_ps(
            _mm_and_ps(_mm_cmpge_ps(size, _mm_set1_ps(SMALL)), _mm_cmple_ps(size, _mm_set1_ps(1.0 / SMALL))),
            _mm_cmple_ps(_mm_andnot_ps(sign, origin), _mm_set1_ps(query::NEAR * largest_coordinate)),
        );
        let (inverse, padding) = if _mm_movemask_ps(is_ordinary) & 7 == 7 && ray.t_max > 0.0 {
            (_mm_div_ps(_mm_set1_ps(1.0), direction), query::padding(0.0, largest_coordinate))
        } else {
            inverse_with_care(ray, largest_coordinate)?
        };
        let towards_entry = _mm_or_ps(_mm_set1_ps(padding), _mm_and_ps(sign, direction));
        let minus_inverse = _mm_xor_ps(sign, inverse);
        let entry_offset = _mm_mul_ps(_mm_add_ps(origin, towards_entry), minus_inverse);
        let exit_offset = _mm_mul_ps(_mm_sub_ps(origin, towards_entry), minus_inverse);
        // Bits of sign choose the rows, without a branch: they cannot be foretold.
        let is_negative = _mm_movemask_ps(direction) as usize;
        let entry_plane = [0, 1, 2].map(|axis| ROW * axis + 3 * ROW * (is_negative >> axis & 1));
        let exit_plane = [0, 1, 2].map(|axis| ROW * (2 * axis + 3) - entry_plane[axis]);

        // All three lanes of `largest` are the largest component; the first that equals it is the last axis.
        let turned = _mm_shuffle_ps::<0b11_00_10_01>(size, size);
        let turned_twice = _mm_shuffle_ps::<0b11_01_00_10>(size, size);
        let largest = _mm_max_ps(_mm_max_ps(size, turned), turned_twice);
        let last = (_mm_movemask_ps(_mm_cmpeq_ps(size, largest)) as u32 | 0b100).trailing_zeros() as usize;
        // SAFETY: `last` is below three because of the bit that is set above; a row of `AXES` is four numbers.
        let (axes, points) =
            unsafe { (_mm_loadu_si128(AXES.get_unchecked(last).as_ptr().cast()), *AXIS_ROWS.get_unchecked(last)) };
        let inverse_last = _mm_permutevar_ps(inverse, _mm_set1_epi32(last as i32));
        let shear = _mm_mul_ps(_mm_permutevar_ps(direction, axes), inverse_last);
        Some(Frame {
            entry_plane,
            exit_plane,
            inverse: spread(inverse),
            entry_offset: spread(entry_offset),
            exit_offset: spread(exit_offset),
            points,
            origin: spread(_mm_permutevar_ps(origin, axes)),
            shear: spread(_mm_blend_ps::<0b0100>(shear, inverse_last)),
        })
    }
}

/// The inverse direction and the padding of a ray out of the ordinary; `None` when it is no ray.
#[cold]
#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn inverse_with_care(ray: &Ray, largest_coordinate: f32) -> Option<(__m128, f32)> {
    let [x, y, z] = Query::new(ray, largest_coordinate)?.inverse;
    Some((_mm_setr_ps(x, y, z, 0.0), query::padding(ray.origin.abs().max_element(), largest_coordinate)))
}

/// The first three lanes, each spread over a vector.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn spread(numbers: __m128) -> [__m256; 3] {
    let numbers = _mm256_castps128_ps256(numbers);
    [
        _mm256_permutevar8x32_ps(numbers, _mm256_set1_epi32(0)),
        _mm256_permutevar8x32_ps(numbers, _mm256_set1_epi32(1)),
        _mm256_permutevar8x32_ps(numbers, _mm256_set1_epi32(2)),
    ]
}
