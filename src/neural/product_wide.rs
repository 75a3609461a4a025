//! Products of `f32` matrices in registers of sixteen numbers (AVX-512), for the sizes of small nets.
//!
//! Nets multiply tall matrices by small ones, 16 to 256 on a side. There the `gemm` crate, which knows registers of
//! eight as we build it, packs both sides for caches that the small one fits anyhow. Here only the right side is packed,
//! in panels of at most 64 columns, and a block of rows is summed in registers over the whole inner length. Each number
//! is one sum in the order of the inner index, whatever block it falls in.

/// A matrix by its first number and its strides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strided<'a> {
    /// The numbers.
    pub values: &'a [f32],
    /// From a row to the next.
    pub row: usize,
    /// From a column to the next.
    pub column: usize,
}

/// Numbers in a register.
#[cfg(target_arch = "x86_64")]
const LANES: usize = 16;

/// Rows from which a packed copy of the right side pays.
#[cfg(target_arch = "x86_64")]
const WORTH_PACKING: usize = 64;

/// Whether this processor can.
pub(super) fn is_offered() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        std::arch::is_x86_feature_detected!("avx512f")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// `into += left * right` where [`is_offered`]; returns false, and does nothing, elsewhere. `into` lies row by row. Panics
/// when a slice is shorter than its shape: a defect of the caller.
pub(super) fn multiply_add(
    shape: (usize, usize, usize),
    left: Strided,
    right: Strided,
    into: &mut [f32],
    packed: &mut Vec<f32>,
) -> bool {
    let (rows, inner, columns) = shape;
    if !is_offered() {
        return false;
    }
    if rows == 0 || inner == 0 || columns == 0 {
        return true;
    }
    let reach = |matrix: Strided, rows: usize, columns: usize| (rows - 1) * matrix.row + (columns - 1) * matrix.column;
    assert!(reach(left, rows, inner) < left.values.len() && reach(right, inner, columns) < right.values.len());
    assert_eq!(into.len(), rows * columns);
    #[cfg(target_arch = "x86_64")]
    for first in (0..columns).step_by(4 * LANES) {
        let wide = (columns - first).min(4 * LANES);
        let registers = wide.div_ceil(LANES);
        // Few rows do not pay for a copy of what lies well already.
        let as_it_lies = rows < WORTH_PACKING && right.column == 1 && wide == registers * LANES;
        let (panel_values, stride) = if as_it_lies {
            (&right.values[first..], right.row)
        } else {
            pack(right, inner, first, wide, registers * LANES, packed);
            (packed.as_slice(), registers * LANES)
        };
        let panel = Panel { left, right: panel_values, stride, inner, rows, columns, first, wide };
        // SAFETY: the processor has AVX-512F, asked above; the shapes are within the slices, asserted above, and the
        // right side has `inner` rows, `stride` apart, of `registers` whole registers.
        unsafe {
            match registers {
                1 => panel.run::<1>(into),
                2 => panel.run::<2>(into),
                3 => panel.run::<3>(into),
                _ => panel.run::<4>(into),
            }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = packed;
    true
}

/// Copies columns `first..first + wide` of a matrix, row by row, each row filled up with zeros to `stride`.
#[cfg(target_arch = "x86_64")]
fn pack(right: Strided, inner: usize, first: usize, wide: usize, stride: usize, packed: &mut Vec<f32>) {
    packed.clear();
    packed.resize(inner * stride, 0.0);
    if right.column == 1 {
        for (k, row) in packed.chunks_exact_mut(stride).enumerate() {
            let from = k * right.row + first;
            row[..wide].copy_from_slice(&right.values[from..from + wide]);
        }
    } else {
        // A few rows at a time: what is written across the columns stays in the first cache.
        for rows in (0..inner).step_by(LANES) {
            let end = (rows + LANES).min(inner);
            for column in 0..wide {
                let from = (first + column) * right.column;
                for k in rows..end {
                    packed[k * stride + column] = right.values[from + k * right.row];
                }
            }
        }
    }
}

/// One panel of columns of a product.
#[cfg(target_arch = "x86_64")]
struct Panel<'a> {
    left: Strided<'a>,
    right: &'a [f32],
    stride: usize,
    inner: usize,
    rows: usize,
    columns: usize,
    first: usize,
    wide: usize,
}

#[cfg(target_arch = "x86_64")]
impl Panel<'_> {
    /// All rows, in blocks of six and single ones at the end.
    ///
    /// # Safety
    /// AVX-512F; `right` holds `REGISTERS * 16` numbers in each of `inner` rows, `left` and `into` reach as the shape says.
    #[target_feature(enable = "avx512f")]
    unsafe fn run<const REGISTERS: usize>(&self, into: &mut [f32]) {
        let mut row = 0;
        while row + 6 <= self.rows {
            // SAFETY: the rows are below `self.rows`; the rest is the caller's promise.
            unsafe { self.block::<6, REGISTERS>(row, into) };
            row += 6;
        }
        while row < self.rows {
            // SAFETY: as above.
            unsafe { self.block::<1, REGISTERS>(row, into) };
            row += 1;
        }
    }

    /// Rows `row..row + ROWS`.
    ///
    /// # Safety
    /// As [`Self::run`], and `row + ROWS <= rows`.
    #[target_feature(enable = "avx512f")]
    #[inline]
    unsafe fn block<const ROWS: usize, const REGISTERS: usize>(&self, row: usize, into: &mut [f32]) {
        use std::arch::x86_64::*;
        let last = self.wide - (REGISTERS - 1) * LANES;
        let mask =
            |register: usize| if register + 1 == REGISTERS { (0xffffu32 >> (LANES - last)) as u16 } else { 0xffff };
        // SAFETY: reads and writes stay within the slices as the function's contract says; lanes beyond the last column
        // are masked off.
        unsafe {
            let target = into.as_mut_ptr().add(row * self.columns + self.first);
            let mut sums = [[_mm512_setzero_ps(); REGISTERS]; ROWS];
            for i in 0..ROWS {
                for j in 0..REGISTERS {
                    sums[i][j] = _mm512_maskz_loadu_ps(mask(j), target.add(i * self.columns + j * LANES));
                }
            }
            let mut left = self.left.values.as_ptr().add(row * self.left.row);
            let mut right = self.right.as_ptr();
            let (down, along) = (self.left.row, self.left.column);
            for k in 0..self.inner {
                let mut across = [_mm512_setzero_ps(); REGISTERS];
                for j in 0..REGISTERS {
                    across[j] = _mm512_loadu_ps(right.add(j * LANES));
                }
                for i in 0..ROWS {
                    let own = _mm512_set1_ps(*left.add(i * down));
                    for j in 0..REGISTERS {
                        sums[i][j] = _mm512_fmadd_ps(own, across[j], sums[i][j]);
                    }
                }
                if k + 1 < self.inner {
                    right = right.add(self.stride);
                    left = left.add(along);
                }
            }
            for i in 0..ROWS {
                for j in 0..REGISTERS {
                    _mm512_mask_storeu_ps(target.add(i * self.columns + j * LANES), mask(j), sums[i][j]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_products_agree_with_three_loops_in_every_shape_and_turn() {
        if !is_offered() {
            // Nothing to compare: the door then refuses, which is what its callers rely on.
            let one = Strided { values: &[1.0], row: 1, column: 1 };
            assert!(!multiply_add((1, 1, 1), one, one, &mut [0.0], &mut Vec::new()));
            return;
        }
        for (rows, inner, columns) in
            [(1, 1, 1), (7, 5, 19), (13, 33, 64), (6, 2, 65), (20, 130, 17), (3, 9, 200), (70, 8, 80)]
        {
            let left: Vec<f32> = (0..rows * inner).map(|index| (index as f32 * 0.37).sin()).collect();
            let right: Vec<f32> = (0..inner * columns).map(|index| (index as f32 * 0.71).cos()).collect();
            for turned in 0..4 {
                let own = |turned: bool, values, rows: usize, columns: usize| match turned {
                    false => Strided { values, row: columns, column: 1 },
                    true => Strided { values, row: 1, column: rows },
                };
                let (a, b) = (own(turned & 1 == 1, &left, rows, inner), own(turned & 2 == 2, &right, inner, columns));
                let mut into: Vec<f32> = (0..rows * columns).map(|index| index as f32).collect();
                assert!(multiply_add((rows, inner, columns), a, b, &mut into, &mut vec![7.0; 3]));
                for (index, found) in into.iter().enumerate() {
                    let (row, column) = (index / columns, index % columns);
                    let sum: f64 = (0..inner)
                        .map(|k| {
                            let (x, y) =
                                (a.values[row * a.row + k * a.column], b.values[k * b.row + column * b.column]);
                            f64::from(x) * f64::from(y)
                        })
                        .sum();
                    let near = 1e-5 * (1.0 + sum.abs() + index as f64);
                    assert!((f64::from(*found) - index as f64 - sum).abs() < near, "{rows} {inner} {columns} {turned}");
                }
            }
        }
    }
}
