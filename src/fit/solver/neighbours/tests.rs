use super::*;
use crate::math::random::SequentialRandom;

const SIZE: usize = 8;

fn made_up() -> (Vec<Material<f32>>, Neighbours) {
    let mut random = SequentialRandom::new(3);
    let mut texel = || {
        Material::from_array(std::array::from_fn(|lane| {
            let value = random.next_number();
            if lane < 6 { 0.05 + 0.6 * value } else { -value }
        }))
    };
    let (texels, start): (Vec<_>, Vec<_>) = (0..SIZE * SIZE).map(|_| (texel(), texel())).unzip();
    let shown = (0..SIZE * SIZE).map(|texel| texel % 11 != 5).collect();
    (texels, Neighbours { scales: [0.5, 0.2, 0.3], ..Neighbours::new(SIZE, &start, shown, 1.0) })
}

/// The same texels with half of them dielectrics, of which it is known.
fn made_up_of_dielectrics() -> (Vec<Material<f32>>, Neighbours) {
    let (mut texels, mut beliefs) = made_up();
    texels.iter_mut().step_by(2).for_each(|own| own.specular = own.specular.map(|specular| 0.2 * specular));
    beliefs.know_dielectrics(&texels);
    (texels, beliefs)
}

#[test]
fn a_dielectric_is_drawn_to_the_common_one_and_a_metal_is_not() {
    let (texels, beliefs) = made_up_of_dielectrics();
    let is_known = |texel: &usize| beliefs.precision_of_specular(*texel) > 0.0;
    let metals: Vec<usize> = (0..texels.len()).filter(|&texel| !is_dielectric(texels[texel].specular)).collect();
    assert!(metals.len() > 8 && !metals.iter().any(is_known), "{metals:?}");
    let dielectrics: Vec<usize> = (0..texels.len()).filter(is_known).collect();
    assert_eq!(dielectrics.len() + metals.len(), texels.len());
    let energy = |specular: f32| {
        let mut texels = texels.clone();
        dielectrics.iter().for_each(|&texel| texels[texel].specular = [specular; 3]);
        beliefs.energies(&texels)[1]
    };
    assert_eq!(energy(PLAIN_SPECULAR), 0.0);
    assert!(energy(0.03) > 0.0 && energy(0.02) > energy(0.03) && energy(0.06) > energy(0.05));
}

fn total(beliefs: &Neighbours, texels: &[Material<f32>]) -> f64 {
    beliefs.energies(texels).iter().sum()
}

#[test]
fn the_slope_is_that_of_the_energies() {
    [made_up(), made_up_of_dielectrics()].iter().for_each(|(texels, beliefs)| slope_is_of_energies(texels, beliefs));
}

fn slope_is_of_energies(texels: &[Material<f32>], beliefs: &Neighbours) {
    let parabola = beliefs.parabola(texels);
    for texel in (0..SIZE * SIZE).step_by(5) {
        for lane in 0..7 {
            let at = |step: f32| {
                let mut moved = texels.to_vec();
                let mut own = moved[texel].to_array();
                own[lane] += step;
                moved[texel] = Material::from_array(own);
                total(beliefs, &moved)
            };
            let slope = (at(1e-3) - at(-1e-3)) / 2e-3;
            let found = f64::from(parabola.slope()[texel][lane]);
            assert!((found - slope).abs() < 0.02 * (slope.abs() + 1.0), "{texel} {lane}: {found} {slope}");
        }
    }
}

/// In logarithms of reflectances and widths, which the curvature is of.
#[test]
fn the_parabola_touches_and_lies_above() {
    [made_up(), made_up_of_dielectrics()].iter().for_each(|(texels, beliefs)| parabola_lies_above(texels, beliefs));
}

fn parabola_lies_above(texels: &[Material<f32>], beliefs: &Neighbours) {
    let parabola = beliefs.parabola(texels);
    let here = total(beliefs, texels);
    let mut random = SequentialRandom::new(8);
    for _ in 0..40 {
        let reach = 0.05 * random.next_number();
        let steps: Vec<Lanes> = texels
            .iter()
            .map(|_| std::array::from_fn(|lane| if lane < 7 { reach * (random.next_number() - 0.5) } else { 0.0 }))
            .collect();
        let moved: Vec<Material<f32>> = texels
            .iter()
            .zip(&steps)
            .map(|(texel, step)| {
                let own = texel.to_array();
                Material::from_array(std::array::from_fn(|lane| own[lane] + step[lane]))
            })
            .collect();
        let mut product = vec![[0.0; 8]; texels.len()];
        parabola.add_product(&steps, &mut product);
        let along = |of: &[Lanes]| -> f64 {
            steps.iter().flatten().zip(of.iter().flatten()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let above = here + along(parabola.slope()) + 0.5 * along(&product);
        let there = total(beliefs, &moved);
        // The logarithm's own bend is small beside the parabola's.
        assert!(there < above + 0.02 * (above - here).abs() + 1e-3, "{there} {above} {here}");
        let curvature: f64 = steps
            .iter()
            .enumerate()
            .map(|(texel, step)| -> f64 {
                let diagonal = parabola.diagonal(texel);
                (0..7).map(|lane| f64::from(diagonal[lane] * step[lane] * step[lane])).sum()
            })
            .sum();
        assert!(along(&product) <= 2.0 * curvature, "{} {curvature}", along(&product));
    }
}

#[test]
fn edges_between_materials_cost_little_more_when_they_are_sharper() {
    let (mut texels, _) = made_up();
    let flat = Material { diffuse: [0.3; 3], specular: [0.04; 3], log_width: -0.5 };
    texels.fill(flat);
    let beliefs = Neighbours { scales: [0.1; 3], ..Neighbours::new(SIZE, &texels, vec![true; SIZE * SIZE], 1.0) };
    let step = |ratio: f32| {
        let mut texels = texels.clone();
        texels[..SIZE * SIZE / 2].iter_mut().for_each(|texel| texel.diffuse = [0.3 * ratio; 3]);
        total(&beliefs, &texels)
    };
    assert_eq!(step(1.0), 0.0);
    assert!(step(1.1) > 0.0 && step(4.0) < 2.0 * step(2.0), "{} {} {}", step(1.1), step(2.0), step(4.0));
}
