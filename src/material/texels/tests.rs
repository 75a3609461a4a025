use super::*;
use crate::material::{GradientPyramid, TexelGradient};
use crate::math::random::SequentialRandom;

fn random_texels(count: usize, seed: u64) -> Vec<Material<f64>> {
    let mut random = SequentialRandom::new(seed);
    let mut number = || f64::from(random.next_number()) - 0.4;
    (0..count).map(|_| Material::from_array(std::array::from_fn(|_| number()))).collect()
}

#[test]
fn pulling_down_is_the_transpose_of_building() {
    let covered = Image::from_fn(16, 8, |row, column| (row * 7 + column * 3) % 5 != 0 && row != 3);
    let weights = PyramidWeights::new(&covered, 4);
    assert_eq!(weights.level_count(), 4);
    let base = random_texels(128, 1);
    let built = TexelPyramid::from_base(base.clone(), &weights);
    let mut probe = GradientPyramid::<f64>::zeros(&weights);
    for (level, texels) in probe.levels.iter_mut().enumerate() {
        let random = random_texels(texels.texels.len(), 10 + level as u64);
        texels.texels = random.into_iter().map(|d_material| TexelGradient { d_material, evidence: 1.0 }).collect();
    }
    let dot = |a: &[Material<f64>], b: &[TexelGradient<f64>]| -> f64 {
        let pairs = a.iter().zip(b).map(|(a, b)| (a.to_array(), b.d_material.to_array()));
        pairs.flat_map(|(a, b)| (0..7).map(move |number| a[number] * b[number])).sum()
    };
    let forward: f64 = built.levels.iter().zip(&probe.levels).map(|(a, b)| dot(&a.texels, &b.texels)).sum();
    probe.pull_down(&weights);
    let backward = dot(&base, &probe.levels[0].texels);
    assert!((forward - backward).abs() < 1e-10 * forward.abs(), "{forward} {backward}");
}

#[test]
fn one_changed_texel_rebuilds_like_all() {
    let covered = Image::from_fn(16, 8, |row, column| (row + column) % 3 != 0);
    let weights = PyramidWeights::new(&covered, 4);
    let mut base = random_texels(128, 2);
    let mut one = TexelPyramid::from_base(base.clone(), &weights);
    for index in [0, 17, 63, 127] {
        base[index] = Material::from_array([3.0; 7]);
        one.levels[0].texels[index] = Material::from_array([3.0; 7]);
        one.rebuild_above(&weights, index);
        assert_eq!(one, TexelPyramid::from_base(base.clone(), &weights));
    }
}

#[test]
fn uncovered_texels_do_not_leak_into_coarse_levels() {
    let covered = Image::from_fn(8, 8, |_, column| column < 5);
    let weights = PyramidWeights::new(&covered, 3);
    let texels = (0..64).map(|index| Material::from_array([if index % 8 < 5 { 1.0f32 } else { 100.0 }; 7])).collect();
    let pyramid = TexelPyramid::from_base(texels, &weights);
    assert!((pyramid.levels[1].texels[2].diffuse[0] - 1.0).abs() < 1e-6, "the parent across the border");
    assert!((pyramid.levels[2].texels[1].specular[0] - 1.0).abs() < 1e-6);
}

#[test]
fn taps_follow_the_texture_convention() {
    let tap = TextureTap::at(Vec2::new(2.5 / 8.0, 1.0 - 1.5 / 4.0), 0, 8, 4);
    let own: f32 = (0..4).filter(|&k| tap.index[k] == 10).map(|k| tap.weight[k]).sum();
    assert!((own - 1.0).abs() < 1e-5, "centre of row 1, column 2");
    for uv in [Vec2::NAN, Vec2::splat(f32::INFINITY), Vec2::splat(-1e30)] {
        assert!(TextureTap::at(uv, 0, 8, 4).index.iter().all(|&index| index < 32));
    }
}

#[test]
fn maps_round_trip() {
    let maps = MaterialMaps {
        diffuse: Image::from_fn(4, 2, |row, column| Vec3::new(0.1 * row as f32, 0.2 * column as f32, 1.0)),
        specular: Image::filled(4, 2, Vec3::splat(0.04)),
        roughness: Image::from_fn(4, 2, |row, column| 0.1 + 0.2 * row as f32 + 0.1 * column as f32),
    };
    let again = maps_from_texels(&texels_from_maps(&maps), 4, 2);
    assert_eq!(again.diffuse, maps.diffuse);
    for (a, b) in again.roughness.pixels().iter().zip(maps.roughness.pixels()) {
        assert!((a - b).abs() < 1e-6);
    }
}
