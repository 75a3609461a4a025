use super::*;

#[test]
fn logarithms_and_powers_keep_their_digits() {
    for step in 1..4000 {
        let x = step as f32 / 4000.0;
        let mut out = [0.0; 8];
        Plain::splat(x).log2().store(&mut out);
        let truth = f64::from(x).log2();
        assert!((f64::from(out[3]) - truth).abs() < 3e-7 * (1.0 + truth.abs()), "{x}: {} {truth}", out[3]);
        let y = -130.0 * x;
        Plain::splat(y).exp2().store(&mut out);
        let truth = f64::from(y.max(-126.0)).exp2();
        assert!((f64::from(out[5]) / truth - 1.0).abs() < 1e-6, "{y}: {} {truth}", out[5]);
    }
    // Just below 1, where a sharp lobe lives.
    let mut out = [0.0; 8];
    Plain::splat(1.0 - 1e-6).log2().store(&mut out);
    let truth = f64::from(1.0f32 - 1e-6).log2();
    assert!((f64::from(out[0]) / truth - 1.0).abs() < 1e-5);
}

/// What each operation makes of the numbers and of their neighbours, one after the other.
fn operations<V: Vector>(numbers: &[f32]) -> Vec<f32> {
    let mut made = Vec::new();
    for at in (0..numbers.len() - V::LANES).step_by(V::LANES) {
        let (a, b) = (V::load(&numbers[at..]), V::load(&numbers[at + 1..]));
        let bytes: Vec<u8> = numbers[at..].iter().map(|&value| (value * 200.0) as u8).take(V::LANES).collect();
        let halves: Vec<u16> =
            numbers[at..].iter().map(|&value| (value.to_bits() >> 16) as u16).take(V::LANES).collect();
        let (exponent, mantissa) = a.split();
        let whole = a.mul(b).mul(V::splat(40.0)).round();
        for value in [
            V::load_bytes(&bytes),
            V::load_upper_halves(&halves),
            a.add(b),
            a.sub(b),
            a.mul(b),
            a.div(b),
            a.mul_add(b, V::splat(0.25)),
            a.max(b),
            a.min(b),
            a.sqrt(),
            a.sub(b).where_positive(a, b.mul(V::splat(3.0))),
            exponent,
            mantissa,
            whole,
            whole.power_of_two(),
            a.log2(),
            V::splat(0.0).sub(a).mul(V::splat(50.0)).exp2(),
        ] {
            let mut out = [0.0; WIDEST];
            value.store(&mut out);
            made.extend(&out[..V::LANES]);
            made.push(value.sum());
            made.push(f32::from(u8::from(value.any_positive())));
        }
    }
    made
}

/// The same in the order of vectors of another width: operation by operation. Sums are of eight at least.
fn compare<V: Vector>(numbers: &[f32], found: &[f32]) {
    const OPERATIONS: usize = 17;
    let plain = operations::<Plain>(numbers);
    let of = |made: &[f32], lanes: usize, operation: usize, index: usize| {
        made[(index / lanes * OPERATIONS + operation) * (lanes + 2) + index % lanes]
    };
    let count = numbers.len() / WIDEST * WIDEST - WIDEST;
    for operation in 0..OPERATIONS {
        for index in 0..count {
            let (own, truth) = (of(found, V::LANES, operation, index), of(&plain, 8, operation, index));
            assert!((own - truth).abs() <= 1e-6 * (1.0 + truth.abs()), "{operation} at {index}: {own} {truth}");
        }
        for vector in 0..count / V::LANES {
            let end = (vector * OPERATIONS + operation) * (V::LANES + 2) + V::LANES;
            let own: f64 = found[end - V::LANES..end].iter().map(|&value| f64::from(value)).sum();
            assert!((f64::from(found[end]) - own).abs() <= 1e-6 * (1.0 + own.abs()) * V::LANES as f64);
            let any = found[end - V::LANES..end].iter().any(|&value| value > 0.0);
            assert_eq!(found[end + 1] > 0.0, any);
        }
    }
}

#[test]
fn every_kind_of_vector_does_what_plain_ones_do() {
    let mut random = crate::math::random::SequentialRandom::new(11);
    let numbers: Vec<f32> = (0..1024).map(|_| 0.01 + 1.2 * random.next_number()).collect();
    compare::<Plain>(&numbers, &operations::<Plain>(&numbers));
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx512f")]
        fn avx512(numbers: &[f32]) -> Vec<f32> {
            operations::<Avx512>(numbers)
        }
        #[target_feature(enable = "avx2,fma")]
        fn avx2(numbers: &[f32]) -> Vec<f32> {
            operations::<Avx2>(numbers)
        }
        if has_avx2() {
            // SAFETY: the processor has what the function is compiled for.
            compare::<Avx2>(&numbers, &unsafe { avx2(&numbers) });
        } else {
            println!("not compared: this processor has no AVX2");
        }
        if has_avx512() {
            // SAFETY: as above.
            compare::<Avx512>(&numbers, &unsafe { avx512(&numbers) });
        } else {
            println!("not compared: this processor has no AVX-512");
        }
    }
    #[cfg(target_arch = "aarch64")]
    compare::<Neon>(&numbers, &operations::<Neon>(&numbers));
}
