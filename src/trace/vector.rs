//! The walk through the tree with AVX2: eight boxes or eight triangles at a time.
//!
//! The triangle test is that of `plain`, the same sums in the same order, so that the hits are the same bits;
//! `tests/trace.rs` compares the two. The box test is fused and only has to be wide enough.
//!
//! A ray visits some four nodes and one block; its time goes into waiting for memory and into branches that cannot be
//! foretold. What that taught, in change of rays a second on 100 000 triangles: one inlined function a question, with
//! nothing reloaded after a call, +10 %; fused box test with a shorter chain, +3 %; fetching the child that is pushed,
//! +4 %; a query that never goes through memory, +45 % for camera rays and +5 % for others; pushing all children of an
//! occlusion ray at once, +15 %; blocks of shared points, half as large, +4 %. Of no use were AVX-512, blocks of four
//! triangles (more nodes), and sorting the children of a node without a branch (longer than the branch costs).

use super::frame::Frame;
use super::plain::Best;
use super::wide::{BLOCK, LANES, STACK_SIZE, TriangleBlock, WIDTH, WideNode, WideTree};
use super::{Hit, Ray};
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

/// See [`super::plain::closest_hit`].
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn closest_hit(tree: &WideTree, ray: &Ray, largest_coordinate: f32) -> Option<Hit> {
    let frame = Frame::new(ray, largest_coordinate)?;
    let mut best = Best::end_of_ray(ray.t_max);
    // Entry distance in the upper half, reference in the lower: as distances are not negative, keys sort like them.
    let mut stack = [const { MaybeUninit::<u64>::uninit() }; STACK_SIZE];
    let bottom = stack.as_mut_ptr().cast::<u64>();
    let mut top = bottom;
    let mut reference = 0;
    // SAFETY: references are those that `collapse::build` wrote. The tree is at most as deep as `STACK_SIZE` allows for:
    // every level leaves seven keys, the last eight. Keys are read between `bottom` and `top` only, where they were
    // written.
    unsafe {
        loop {
            if reference & BLOCK == 0 {
                let node = tree.nodes.get_unchecked(reference as usize);
                let (entries, mut met) = test_node(node, &frame, best.t);
                if met != 0 {
                    let nearest = met.trailing_zeros() as usize % WIDTH;
                    met &= met - 1;
                    if met == 0 {
                        reference = node.children[nearest];
                        continue;
                    }
                    let mut distances = [0.0f32; WIDTH];
                    _mm256_storeu_ps(distances.as_mut_ptr(), entries);
                    let key = |slot: usize| u64::from(distances[slot].to_bits()) << 32 | u64::from(node.children[slot]);
                    let (first, second) = (key(nearest), key(met.trailing_zeros() as usize % WIDTH));
                    met &= met - 1;
                    let (near, far) = (first.min(second), first.max(second));
                    fetch(tree, far as u32);
                    let base = top;
                    top.write(far);
                    top = top.add(1);
                    if met == 0 {
                        reference = near as u32;
                        continue;
                    }
                    // Three or more: insert one by one, farthest lowest.
                    top.write(near);
                    top = top.add(1);
                    while met != 0 {
                        let item = key(met.trailing_zeros() as usize % WIDTH);
                        met &= met - 1;
                        let mut hole = top;
                        top = top.add(1);
                        while hole > base && *hole.sub(1) < item {
                            *hole = *hole.sub(1);
                            hole = hole.sub(1);
                        }
                        *hole = item;
                    }
                    top = top.sub(1);
                    reference = *top as u32;
                    continue;
                }
            } else {
                test_block::<false>(tree, reference & !BLOCK, &frame, &mut best);
            }
            loop {
                if top == bottom {
                    return best.hit(tree);
                }
                top = top.sub(1);
                if f32::from_bits((*top >> 32) as u32) <= best.t {
                    reference = *top as u32;
                    break;
                }
            }
        }
    }
}

/// See [`super::plain::is_occluded`].
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn is_occluded(tree: &WideTree, ray: &Ray, largest_coordinate: f32) -> bool {
    let Some(frame) = Frame::new(ray, largest_coordinate) else { return false };
    let mut end = Best::end_of_ray(ray.t_max);
    let mut stack = [const { MaybeUninit::<u32>::uninit() }; STACK_SIZE + WIDTH];
    let bottom = stack.as_mut_ptr().cast::<u32>();
    let mut top = bottom;
    let mut reference = 0;
    // SAFETY: as in `closest_hit`; eight references are written at a time, for which there is room behind the last.
    unsafe {
        loop {
            if reference & BLOCK == 0 {
                let node = tree.nodes.get_unchecked(reference as usize);
                let (_, met) = test_node(node, &frame, ray.t_max);
                if met != 0 {
                    reference = node.children[met.trailing_zeros() as usize % WIDTH];
                    let others = met & (met - 1);
                    if others != 0 {
                        fetch(tree, node.children[others.trailing_zeros() as usize % WIDTH]);
                        let order = _mm_loadl_epi64(SLOTS_OF.get_unchecked(others as usize).as_ptr().cast());
                        let children = _mm256_load_si256(node.children.as_ptr().cast());
                        let packed = _mm256_permutevar8x32_epi32(children, _mm256_cvtepu8_epi32(order));
                        _mm256_storeu_si256(top.cast(), packed);
                        top = top.add(others.count_ones() as usize);
                    }
                    continue;
                }
            } else if test_block::<true>(tree, reference & !BLOCK, &frame, &mut end) {
                return true;
            }
            if top == bottom {
                return false;
            }
            top = top.sub(1);
            reference = *top;
        }
    }
}

/// The slots of the bits of each mask, the highest first.
static SLOTS_OF: [[u8; WIDTH]; 1 << WIDTH] = {
    let mut table = [[0; WIDTH]; 1 << WIDTH];
    let mut mask = 0;
    while mask < 1 << WIDTH {
        let (mut slot, mut place) = (WIDTH, 0);
        while slot > 0 {
            slot -= 1;
            if mask >> slot & 1 == 1 {
                table[mask][place] = slot as u8;
                place += 1;
            }
        }
        mask += 1;
    }
    table
};

/// Asks the memory for a node or block that will be needed later; a hint, which may name any address.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn fetch(tree: &WideTree, reference: u32) {
    let node = tree.nodes.as_ptr().wrapping_add(reference as usize).cast::<i8>();
    let block = tree.blocks.as_ptr().wrapping_add((reference & !BLOCK) as usize).cast::<i8>();
    let start = if reference & BLOCK == 0 { node } else { block };
    for line in 0..size_of::<WideNode>() / 64 {
        _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line));
    }
}

/// Where the ray enters each child's box, and one bit a child for whether it does.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn test_node(node: &WideNode, frame: &Frame, t_max: f32) -> (__m256, u32) {
    // SAFETY: `Frame` holds places of rows of planes, each row is eight numbers, nodes are aligned to 64 bytes.
    let row = |bytes: usize| unsafe { _mm256_load_ps(std::ptr::from_ref(node).cast::<f32>().byte_add(bytes)) };
    let entry =
        |axis: usize| _mm256_fmadd_ps(row(frame.entry_plane[axis]), frame.inverse[axis], frame.entry_offset[axis]);
    let exit = |axis: usize| _mm256_fmadd_ps(row(frame.exit_plane[axis]), frame.inverse[axis], frame.exit_offset[axis]);
    // Where the first operand is a NaN, these give the second.
    let entry = _mm256_max_ps(_mm256_max_ps(entry(0), entry(1)), _mm256_max_ps(entry(2), _mm256_setzero_ps()));
    let exit = _mm256_min_ps(_mm256_min_ps(exit(0), exit(1)), _mm256_min_ps(exit(2), _mm256_set1_ps(t_max)));
    (entry, _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(entry, exit)) as u32)
}

/// See `test_block` of `plain`: keeps the best hit, or, when any hit will do, tells whether there is one.
///
/// It is generic so that there is one call of each kind: a function called once is inlined, and the frame stays in
/// registers.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn test_block<const ANY: bool>(tree: &WideTree, number: u32, frame: &Frame, best: &mut Best) -> bool {
    // SAFETY: only numbers that `collapse::build` wrote are asked for.
    let block: &TriangleBlock = unsafe { tree.blocks.get_unchecked(number as usize) };
    // SAFETY: `Frame` holds places of rows of points, each row is eight numbers, blocks are aligned to 64 bytes.
    let row =
        |axis: usize| unsafe { _mm256_load_ps(std::ptr::from_ref(block).cast::<f32>().byte_add(frame.points[axis])) };
    let height = _mm256_sub_ps(row(2), frame.origin[2]);
    let along = _mm256_sub_ps(_mm256_sub_ps(row(0), frame.origin[0]), _mm256_mul_ps(frame.shear[0], height));
    let across = _mm256_sub_ps(_mm256_sub_ps(row(1), frame.origin[1]), _mm256_mul_ps(frame.shear[1], height));

    // SAFETY: there are eight numbers of 16 bits. Of each lane the permutation reads the lowest three bits only.
    let first = _mm256_cvtepu16_epi32(unsafe { _mm_load_si128(block.corners.as_ptr().cast()) });
    let (second, third) = (_mm256_srli_epi32::<3>(first), _mm256_srli_epi32::<6>(first));
    let (ax, ay) = (_mm256_permutevar8x32_ps(along, first), _mm256_permutevar8x32_ps(across, first));
    let (bx, by) = (_mm256_permutevar8x32_ps(along, second), _mm256_permutevar8x32_ps(across, second));
    let (cx, cy) = (_mm256_permutevar8x32_ps(along, third), _mm256_permutevar8x32_ps(across, third));
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

    let az = _mm256_permutevar8x32_ps(height, first);
    let bz = _mm256_permutevar8x32_ps(height, second);
    let cz = _mm256_permutevar8x32_ps(height, third);
    let sum = _mm256_add_ps(_mm256_add_ps(a, b), c);
    let weighted = _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(a, az), _mm256_mul_ps(b, bz)), _mm256_mul_ps(c, cz));
    let t = _mm256_div_ps(_mm256_mul_ps(weighted, frame.shear[2]), sum);
    let end = _mm256_set1_ps(best.t);
    let is_before_end = if ANY { _mm256_cmp_ps::<_CMP_LT_OQ>(t, end) } else { _mm256_cmp_ps::<_CMP_LE_OQ>(t, end) };
    let is_on_ray = _mm256_and_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(t, zero), is_before_end);
    let mut hits = _mm256_movemask_ps(_mm256_and_ps(is_inside, is_on_ray)) as u32;
    if ANY || hits == 0 {
        return hits != 0;
    }
    let mut numbers = [[0.0f32; LANES]; 4];
    for (numbers, vector) in numbers.iter_mut().zip([t, b, c, sum]) {
        // SAFETY: the array holds eight numbers.
        unsafe { _mm256_storeu_ps(numbers.as_mut_ptr(), vector) };
    }
    while hits != 0 {
        let lane = hits.trailing_zeros() as usize % LANES;
        hits &= hits - 1;
        let [t, b, c, sum] = &numbers;
        best.update(tree, number, lane as u32, [t[lane], b[lane], c[lane], sum[lane]]);
    }
    true
}
