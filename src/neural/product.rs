//! Products of `f32` matrices that lie row by row in memory: a checked door to the `gemm` crate.
//!
//! One thread works on one product. Who wants several threads splits the batch into chunks of a fixed size and adds the
//! results in order, so that bits do not depend on how many threads there are.

/// A matrix that lies row by row in a slice.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// The numbers, `rows * columns` of them.
    pub values: &'a [f32],
    /// How many rows.
    pub rows: usize,
    /// How many columns.
    pub columns: usize,
    /// Whether the product takes the transpose.
    pub transposed: bool,
}

impl<'a> Rows<'a> {
    /// The matrix as it lies. Panics when the slice does not have that many numbers: a defect of the caller.
    pub fn new(values: &'a [f32], rows: usize, columns: usize) -> Self {
        assert_eq!(values.len(), rows * columns, "a matrix of {rows} by {columns}");
        Rows { values, rows, columns, transposed: false }
    }

    /// Its transpose, nothing moved.
    pub fn transpose(self) -> Self {
        Rows { transposed: !self.transposed, ..self }
    }

    fn shape(&self) -> (usize, usize) {
        if self.transposed { (self.columns, self.rows) } else { (self.rows, self.columns) }
    }

    /// Strides of (column, row).
    fn strides(&self) -> (isize, isize) {
        if self.transposed { (self.columns as isize, 1) } else { (1, self.columns as isize) }
    }
}

/// `into = left * right`, or `into += left * right` when `add`. `into` lies row by row. Panics when shapes do not fit.
pub fn multiply(left: Rows, right: Rows, into: &mut [f32], add: bool) {
    let ((rows, inner), (also_inner, columns)) = (left.shape(), right.shape());
    assert_eq!(inner, also_inner, "inner sizes of a product");
    assert_eq!(into.len(), rows * columns, "size of a product");
    if into.is_empty() {
        return;
    }
    if inner == 0 {
        if !add {
            into.fill(0.0);
        }
        return;
    }
    let (left_strides, right_strides) = (left.strides(), right.strides());
    // SAFETY: the three slices hold as many numbers as shapes and strides reach, checked above and in `Rows::new`;
    // `into` is borrowed mutably, so it overlaps neither of the others.
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            into.as_mut_ptr(),
            1,
            columns as isize,
            add,
            left.values.as_ptr(),
            left_strides.0,
            left_strides.1,
            right.values.as_ptr(),
            right_strides.0,
            right_strides.1,
            1.0f32,
            1.0f32,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

/// Sums of the rows of each group.
pub(super) fn sums_by_group(rows: &[f32], groups: usize, rows_per_group: usize, width: usize) -> Vec<f32> {
    let mut sums = vec![0.0f32; groups * width];
    for (block, sum) in rows.chunks(rows_per_group.max(1) * width).zip(sums.chunks_exact_mut(width)) {
        add_rows(block, sum);
    }
    sums
}

/// Adds every row to `sum`.
pub(super) fn add_rows(rows: &[f32], sum: &mut [f32]) {
    for row in rows.chunks_exact(sum.len()) {
        sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_and_their_transposes_agree_with_three_loops() {
        let (rows, inner, columns) = (7, 5, 19);
        let left: Vec<f32> = (0..rows * inner).map(|index| (index as f32 * 0.37).sin()).collect();
        let right: Vec<f32> = (0..inner * columns).map(|index| (index as f32 * 0.71).cos()).collect();
        let mut plain = vec![0.0f32; rows * columns];
        for row in 0..rows {
            for column in 0..columns {
                plain[row * columns + column] =
                    (0..inner).map(|k| left[row * inner + k] * right[k * columns + column]).sum();
            }
        }
        let mut left_turned = vec![0.0; left.len()];
        for row in 0..rows {
            for k in 0..inner {
                left_turned[k * rows + row] = left[row * inner + k];
            }
        }
        let mut into = vec![1.0; rows * columns];
        multiply(Rows::new(&left, rows, inner), Rows::new(&right, inner, columns), &mut into, true);
        assert!(into.iter().zip(&plain).all(|(a, b)| (a - b - 1.0).abs() < 1e-5));
        let turned = Rows::new(&left_turned, inner, rows).transpose();
        multiply(turned, Rows::new(&right, inner, columns), &mut into, false);
        assert!(into.iter().zip(&plain).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}
