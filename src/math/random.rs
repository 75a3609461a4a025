//! Random numbers as a pure function of (seed, step, view, pixel, sample, dimension).
//!
//! Samples of one pixel form an Owen-scrambled Sobol sequence in each pair of dimensions, so that 4, 16 or 64 samples
//! cover the square evenly; pixels are independent of each other. No state is shared: any thread may ask for any
//! number in any order.
//!
//! Source: Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4), listings 1 to 4.

/// What a stream of random numbers belongs to, except for the sample index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamKey(u64);

impl StreamKey {
    /// The stream of one pixel of one view in one step under a seed.
    pub fn new(seed: u64, step: u32, view: u32, pixel: u32) -> Self {
        let mut key = mix(seed ^ 0x9e37_79b9_7f4a_7c15);
        key = mix(key ^ (u64::from(step) << 32 | u64::from(view)));
        StreamKey(mix(key ^ (u64::from(pixel) << 1)))
    }
}

/// The random numbers of one sample: dimension after dimension.
#[derive(Clone, Copy, Debug, Default)]
pub struct SampleStream {
    key: u64,
    sample: u32,
    dimension: u32,
}

impl SampleStream {
    /// The numbers of sample `sample` in the stream of `key`.
    pub fn new(key: StreamKey, sample: u32) -> Self {
        SampleStream { key: key.0, sample, dimension: 0 }
    }

    /// The next number, uniform in [0, 1).
    pub fn next_number(&mut self) -> f32 {
        self.next_pair()[0]
    }

    /// The next pair, uniform in [0, 1)^2.
    pub fn next_pair(&mut self) -> [f32; 2] {
        let hash = self.hash();
        self.dimension += 1;
        scrambled_pair(self.sample, hash as u32, (hash >> 32) as u32)
    }

    /// What the next pair of all samples of the stream is scrambled by.
    #[inline(always)]
    fn hash(&self) -> u64 {
        mix(self.key ^ u64::from(self.dimension).wrapping_mul(0xd134_2543_de82_ef95))
    }
}

/// [`SampleStream::next_pair`] of the first `count` streams, the first numbers of all and then the second ones. It runs on
/// as many at a time as the function it is compiled into has instructions for.
#[inline(always)]
pub fn next_pairs<const N: usize>(streams: &mut [SampleStream; N], count: usize) -> [[f32; N]; 2] {
    let (mut samples, mut low, mut high) = ([0; N], [0; N], [0; N]);
    // Samples of a pixel have their hash in common.
    let mut known = (SampleStream::default(), 0);
    for (lane, stream) in streams[..count].iter_mut().enumerate() {
        if lane == 0 || (known.0.key, known.0.dimension) != (stream.key, stream.dimension) {
            known = (*stream, stream.hash());
        }
        let hash = known.1;
        stream.dimension += 1;
        (samples[lane], low[lane], high[lane]) = (stream.sample, hash as u32, (hash >> 32) as u32);
    }
    let mut numbers = [[0.0; N]; 2];
    for lane in 0..N {
        [numbers[0][lane], numbers[1][lane]] = scrambled_pair(samples[lane], low[lane], high[lane]);
    }
    numbers
}

/// Number `sample` of a Sobol sequence in the square whose order and coordinates are scrambled.
#[inline(always)]
fn scrambled_pair(sample: u32, low: u32, high: u32) -> [f32; 2] {
    // Shuffle the order of samples, then scramble each coordinate of the Sobol point. The first coordinate is the index
    // with its bits reversed, the second is made with its bits reversed: that saves reversals.
    let index = laine_karras(sample.reverse_bits(), low).reverse_bits();
    let x = laine_karras(index, high).reverse_bits();
    let y = laine_karras(sobol_second_reversed(index), low.rotate_left(16) ^ high).reverse_bits();
    [unit_float(x), unit_float(y)]
}

/// A number with the standard normal distribution from two uniform in [0, 1) (Box and Muller 1958).
pub fn normal_number([u, v]: [f32; 2]) -> f32 {
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f32::consts::TAU * v).cos()
}

/// A number in [0, 1) from the upper 24 bits.
#[inline(always)]
fn unit_float(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Second dimension of the Sobol sequence with its bits reversed; the first is the bit reversal of the index.
///
/// Column `k` of its matrix is row `k` of Pascal's triangle modulo 2, where the bit `j` is set if all bits of `j` are
/// among those of `k` (Lucas 1878). So bit `j` of the result is the parity of the index's bits at all places that contain
/// `j`, which five butterflies add up.
#[inline(always)]
fn sobol_second_reversed(mut bits: u32) -> u32 {
    bits ^= bits >> 1 & 0x5555_5555;
    bits ^= bits >> 2 & 0x3333_3333;
    bits ^= bits >> 4 & 0x0f0f_0f0f;
    bits ^= bits >> 8 & 0x00ff_00ff;
    bits ^ bits >> 16
}

/// A hash in which each bit depends on the bits below it only: between two bit reversals it is an Owen scrambling
/// (Laine and Karras 2011, with the constants of Burley 2020, listing 3).
#[inline(always)]
fn laine_karras(value: u32, seed: u32) -> u32 {
    let mut bits = value.wrapping_add(seed);
    bits ^= bits.wrapping_mul(0x6c50_b47c);
    bits ^= bits.wrapping_mul(0xb82f_1e52);
    bits ^= bits.wrapping_mul(0xc7af_e638);
    bits ^= bits.wrapping_mul(0x8d22_f6e6);
    bits
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014): a bijection that spreads every bit.
pub fn mix(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// A small sequential generator for shuffles and tests: SplitMix64.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SequentialRandom(u64);

impl SequentialRandom {
    /// A generator that starts at `seed`.
    pub fn new(seed: u64) -> Self {
        SequentialRandom(mix(seed.wrapping_add(0x1234_5678_9abc_def1)))
    }

    /// The next 64 bits.
    pub fn next_bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// The next number, uniform in [0, 1).
    pub fn next_number(&mut self) -> f32 {
        unit_float((self.next_bits() >> 32) as u32)
    }

    /// A number with the standard normal distribution, from the next two.
    pub fn next_normal(&mut self) -> f32 {
        normal_number([self.next_number(), self.next_number()])
    }

    /// The next whole number in `0..bound`; `bound` must not be 0.
    pub fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.next_bits()) * bound as u128) >> 64) as usize
    }

    /// Shuffles in place (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_of_several_streams_are_those_of_each() {
        let key = |pixel: u32| StreamKey::new(3, 1, 2, pixel);
        let mut several: [SampleStream; 8] =
            std::array::from_fn(|lane| SampleStream::new(key(lane as u32 / 3), 7 * lane as u32));
        let mut single = several;
        for count in [8, 5, 1] {
            let pairs = next_pairs(&mut several, count);
            for lane in 0..count {
                assert_eq!([pairs[0][lane], pairs[1][lane]], single[lane].next_pair(), "stream {lane} of {count}");
            }
        }
    }

    #[test]
    fn sixteen_samples_are_stratified_in_both_axes_and_in_four_by_four_cells() {
        for pixel in 0..50 {
            let key = StreamKey::new(7, 3, 1, pixel);
            let mut rows = [0; 16];
            let mut columns = [0; 16];
            let mut cells = [0; 16];
            for sample in 0..16 {
                let mut stream = SampleStream::new(key, sample);
                stream.next_pair();
                let [x, y] = stream.next_pair();
                assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
                columns[(x * 16.0) as usize] += 1;
                rows[(y * 16.0) as usize] += 1;
                cells[(x * 4.0) as usize * 4 + (y * 4.0) as usize] += 1;
            }
            assert_eq!((rows, columns, cells), ([1; 16], [1; 16], [1; 16]));
        }
    }

    #[test]
    fn butterflies_give_the_second_dimension_by_its_direction_numbers() {
        let mut random = SequentialRandom::new(1);
        for index in [0, 1, u32::MAX].into_iter().chain((0..1000).map(|_| random.next_bits() as u32)) {
            let (mut direction, mut expected) = (1u32, 0);
            for bit in 0..32 {
                expected ^= direction * (index >> bit & 1);
                direction ^= direction << 1;
            }
            assert_eq!(sobol_second_reversed(index), expected, "{index:#x}");
        }
    }

    #[test]
    fn dimensions_and_pixels_are_uncorrelated() {
        let number = |pixel, dimension: usize| {
            let mut stream = SampleStream::new(StreamKey::new(1, 0, 0, pixel), 0);
            for _ in 0..dimension {
                stream.next_number();
            }
            f64::from(stream.next_number()) - 0.5
        };
        let count = 20_000;
        for (other_pixel, other_dimension) in [(0, 1), (1, 0), (0, 2)] {
            let sum: f64 =
                (0..count).map(|pixel| number(pixel, 0) * number(pixel + other_pixel, other_dimension)).sum();
            let standard_error = (f64::from(count)).sqrt() / 12.0;
            assert!(sum.abs() < 4.0 * standard_error, "correlation {sum} against {standard_error}");
        }
    }
}
