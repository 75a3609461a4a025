//! The walk through the tree with AVX2: eight boxes or eight triangles at a time.
//!
//! The sums are those of `plain`, in the same order and without fused multiply and add, so that the hits are the same
//! bits; `tests/trace.rs` compares the two.

use super::Hit;
use super::plain::Best;
use super::query::Query;
use super::wide::{BLOCK, LANES, STACK_SIZE, TriangleBlock, WIDTH, WideNode, WideTree};
use std::arch::x86_64::*;
use std::mem::MaybeUninit;

/// Whether this processor has the instructions of this walk.
pub(super) fn is_available() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

/// The parts of a query, each spread over a vector.
struct Spread {
    entry_row: [usize; 3],
    exit_row: [usize; 3],
    origin_entry: [__m256; 3],
    origin_exit: [__m256; 3],
    inverse: [__m256; 3],
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn spread(query: &Query) -> Spread {
    Spread {
        entry_row: query.entry_row,
        exit_row: query.exit_row,
        origin_entry: query.origin_entry.map(|number| _mm256_set1_ps(number)),
        origin_exit: query.origin_exit.map(|number| _mm256_set1_ps(number)),
        inverse: query.inverse.map(|number| _mm256_set1_ps(number)),
    }
}

/// A stack of which only what was pushed is read. Its size suffices for every tree that `wide::build` lets through.
struct Stack<T: Copy> {
    items: [MaybeUninit<T>; STACK_SIZE],
    height: usize,
}

impl<T: Copy> Stack<T> {
    #[inline(always)]
    fn new() -> Self {
        Stack { items: [const { MaybeUninit::uninit() }; STACK_SIZE], height: 0 }
    }

    #[inline(always)]
    fn push(&mut self, item: T) {
        self.items[self.height].write(item);
        self.height += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<T> {
        if self.height == 0 {
            return None;
        }
        self.height -= 1;
        // SAFETY: every item below the height was written by `push`.
        Some(unsafe { self.items[self.height].assume_init() })
    }

    /// Brings the topmost items, from `base` on, in order: the largest lowest.
    #[inline(always)]
    fn sort_from(&mut self, base: usize)
    where
        T: Ord,
    {
        for place in base + 1..self.height {
            // SAFETY: every item below the height was written by `push`.
            let item = unsafe { self.items[place].assume_init() };
            let mut hole = place;
            while hole > base {
                // SAFETY: as above.
                let below = unsafe { self.items[hole - 1].assume_init() };
                if below >= item {
                    break;
                }
                self.items[hole].write(below);
                hole -= 1;
            }
            self.items[hole].write(item);
        }
    }
}

/// See [`super::plain::closest_hit`].
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn closest_hit(tree: &WideTree, query: &Query) -> Option<Hit> {
    let mut best = Best::end_of(query);
    let mut found = false;
    let spread = spread(query);
    // Entry distance in the upper half, reference in the lower: the order of keys is that of distances.
    let mut stack = Stack::<u64>::new();
    let mut reference = 0u32;
    loop {
        if reference & BLOCK == 0 {
            let node = &tree.nodes[reference as usize];
            let (entries, mut mask) = test_node(node, &spread, best.t);
            if mask != 0 {
                let slot = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                if mask == 0 {
                    reference = node.children[slot & 7];
                    continue;
                }
                let mut distances = [0.0f32; WIDTH];
                // SAFETY: the array holds eight numbers.
                unsafe { _mm256_storeu_ps(distances.as_mut_ptr(), entries) };
                let key =
                    |slot: usize| u64::from(distances[slot & 7].to_bits()) << 32 | u64::from(node.children[slot & 7]);
                let first = key(slot);
                let second = key(mask.trailing_zeros() as usize);
                mask &= mask - 1;
                if mask == 0 {
                    stack.push(first.max(second));
                    reference = first.min(second) as u32;
                    continue;
                }
                let base = stack.height;
                stack.push(first);
                stack.push(second);
                while mask != 0 {
                    stack.push(key(mask.trailing_zeros() as usize));
                    mask &= mask - 1;
                }
                stack.sort_from(base);
            }
        } else {
            let block = &tree.blocks[(reference & !BLOCK) as usize];
            found |= test_block(block, query, &mut best);
        }
        loop {
            let Some(key) = stack.pop() else {
                return found.then_some(best.into());
            };
            if f32::from_bits((key >> 32) as u32) <= best.t {
                reference = key as u32;
                break;
            }
        }
    }
}

/// See [`super::plain::is_occluded`].
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn is_occluded(tree: &WideTree, query: &Query) -> bool {
    let spread = spread(query);
    let mut stack = Stack::<u32>::new();
    let mut reference = 0u32;
    loop {
        if reference & BLOCK == 0 {
            let node = &tree.nodes[reference as usize];
            let (_, mut mask) = test_node(node, &spread, query.t_max);
            while mask != 0 {
                stack.push(node.children[mask.trailing_zeros() as usize & 7]);
                mask &= mask - 1;
            }
        } else {
            let block = &tree.blocks[(reference & !BLOCK) as usize];
            if test_block(block, query, &mut Best::end_of(query)) {
                return true;
            }
        }
        match stack.pop() {
            Some(next) => reference = next,
            None => return false,
        }
    }
}

/// See [`super::plain`]: where the ray enters each child's box, and one bit a child for whether it does.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn test_node(node: &WideNode, spread: &Spread, t_max: f32) -> (__m256, u32) {
    let mut entry = _mm256_setzero_ps();
    let mut exit = _mm256_set1_ps(t_max);
    for axis in 0..3 {
        // SAFETY: rows are below six (`Query::new`), each row holds eight numbers, nodes are aligned to 32 bytes.
        let (entry_planes, exit_planes) = unsafe {
            (
                _mm256_load_ps(node.planes.get_unchecked(spread.entry_row[axis]).as_ptr()),
                _mm256_load_ps(node.planes.get_unchecked(spread.exit_row[axis]).as_ptr()),
            )
        };
        let to_entry = _mm256_mul_ps(_mm256_sub_ps(entry_planes, spread.origin_entry[axis]), spread.inverse[axis]);
        let to_exit = _mm256_mul_ps(_mm256_sub_ps(exit_planes, spread.origin_exit[axis]), spread.inverse[axis]);
        // Where the first operand is a NaN, these give the second.
        entry = _mm256_max_ps(to_entry, entry);
        exit = _mm256_min_ps(to_exit, exit);
    }
    (entry, _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(entry, exit)) as u32)
}

/// See [`super::plain`]: tests a block of triangles and keeps the best hit.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn test_block(block: &TriangleBlock, query: &Query, best: &mut Best) -> bool {
    let [x, y, z] = query.axes;
    let origin = [x, y, z].map(|axis| _mm256_set1_ps(query.origin[axis % 3]));
    let shear = query.shear.map(|number| _mm256_set1_ps(number));
    let corner = |corner: usize| {
        // SAFETY: axes are below three (`Query::new`), each row holds eight numbers, blocks are aligned to 32 bytes.
        let row = |axis: usize| unsafe { _mm256_load_ps(block.corners[corner].get_unchecked(axis).as_ptr()) };
        let height = _mm256_sub_ps(row(z), origin[2]);
        let along = _mm256_sub_ps(_mm256_sub_ps(row(x), origin[0]), _mm256_mul_ps(shear[0], height));
        let across = _mm256_sub_ps(_mm256_sub_ps(row(y), origin[1]), _mm256_mul_ps(shear[1], height));
        [along, across, height]
    };
    let [ax, ay, az] = corner(0);
    let [bx, by, bz] = corner(1);
    let [cx, cy, cz] = corner(2);
    let a = _mm256_sub_ps(_mm256_mul_ps(cx, by), _mm256_mul_ps(cy, bx));
    let b = _mm256_sub_ps(_mm256_mul_ps(ax, cy), _mm256_mul_ps(ay, cx));
    let c = _mm256_sub_ps(_mm256_mul_ps(bx, ay), _mm256_mul_ps(by, ax));
    let zero = _mm256_setzero_ps();
    let lowest = _mm256_min_ps(_mm256_min_ps(a, b), c);
    let highest = _mm256_max_ps(_mm256_max_ps(a, b), c);
    let is_inside = _mm256_or_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(lowest, zero), _mm256_cmp_ps::<_CMP_LE_OQ>(highest, zero));
    if _mm256_movemask_ps(is_inside) == 0 {
        return false;
    }
    let sum = _mm256_add_ps(_mm256_add_ps(a, b), c);
    let weighted = _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(a, az), _mm256_mul_ps(b, bz)), _mm256_mul_ps(c, cz));
    let t = _mm256_div_ps(_mm256_mul_ps(weighted, shear[2]), sum);
    let is_on_ray =
        _mm256_and_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(t, zero), _mm256_cmp_ps::<_CMP_LE_OQ>(t, _mm256_set1_ps(best.t)));
    let mut mask = _mm256_movemask_ps(_mm256_and_ps(is_inside, is_on_ray)) as u32;
    if mask == 0 {
        return false;
    }
    let mut numbers = [[0.0f32; LANES]; 4];
    for (row, vector) in numbers.iter_mut().zip([t, b, c, sum]) {
        // SAFETY: the row holds eight numbers.
        unsafe { _mm256_storeu_ps(row.as_mut_ptr(), vector) };
    }
    let mut found = false;
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize & 7;
        mask &= mask - 1;
        found |=
            best.update(numbers[0][lane], block.triangles[lane], numbers[1][lane], numbers[2][lane], numbers[3][lane]);
    }
    found
}
