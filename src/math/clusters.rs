//! Cells of a grid that hold together.

/// The clusters of cells that are set, each of which holds together over faces; of a flat grid, over edges. Cells lie
/// along x first, then y, then z; clusters come in the order of their first cells.
pub fn clusters(is_set: &[bool], [nx, ny, nz]: [usize; 3]) -> Vec<Vec<usize>> {
    let mut all = Vec::new();
    let mut seen = vec![false; is_set.len()];
    for start in 0..is_set.len() {
        if seen[start] || !is_set[start] {
            continue;
        }
        let mut cluster = vec![start];
        seen[start] = true;
        let mut next = 0;
        while next < cluster.len() {
            let cell = cluster[next];
            next += 1;
            let (x, y, z) = (cell % nx, cell / nx % ny, cell / (nx * ny));
            let around = [
                (x > 0, cell.wrapping_sub(1)),
                (x + 1 < nx, cell + 1),
                (y > 0, cell.wrapping_sub(nx)),
                (y + 1 < ny, cell + nx),
                (z > 0, cell.wrapping_sub(nx * ny)),
                (z + 1 < nz, cell + nx * ny),
            ];
            for (exists, other) in around {
                if exists && is_set[other] && !seen[other] {
                    seen[other] = true;
                    cluster.push(other);
                }
            }
        }
        all.push(cluster);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clusters_hold_together_over_faces_and_not_around_borders() {
        let mut is_set = [false; 24];
        for cell in [0, 1, 5, 17, 11, 22, 3] {
            is_set[cell] = true;
        }
        let mut found = clusters(&is_set, [4, 3, 2]);
        found.iter_mut().for_each(|cluster| cluster.sort_unstable());
        assert_eq!(found, [vec![0, 1, 5, 17], vec![3], vec![11], vec![22]]);
        assert!(clusters(&[false; 24], [4, 3, 2]).is_empty() && clusters(&[], [0, 3, 2]).is_empty());
        assert_eq!(clusters(&[true, true, false, true], [2, 2, 1]), [vec![0, 1, 3]]);
    }
}
