//! Addressed random streams and the samplers that read them.
//!
//! A stream is derived from a [`RandomKey`], never shared, so a draw made here leaves every other
//! stream where it was. The generator is PCG XSL RR 128/64 from `rand_pcg`; the samplers are
//! written here and pinned by golden vectors, because those of general crates change between
//! versions and platforms. Transcendental functions go through `libm`.

mod ziggurat;

use rand_core::Rng;
use rand_pcg::Pcg64;
use xxhash_rust::xxh3::{xxh3_64, xxh3_128};

/// The most parts a [`RandomKey`] can have.
const MAX_PARTS: usize = 12;

/// The address of a random stream: the run's seed and what the draws are for.
///
/// ```
/// use farside::random::RandomKey;
/// let key = RandomKey::new(7).text("rover_1").text("wheel_slip").number(0);
/// let (mut a, mut b) = (key.stream(), key.stream());
/// assert_eq!(a.next_u64(), b.next_u64());
/// assert_ne!(key.number(1).uniform(), key.number(2).uniform());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct RandomKey {
    /// The parts as they are hashed: little-endian, one after the other.
    bytes: [u8; MAX_PARTS * 8],
    /// How many bytes are used.
    len: usize,
}

impl RandomKey {
    /// A key under the run's `seed`.
    #[inline]
    pub fn new(seed: u64) -> Self {
        let (bytes, len) = ([0; MAX_PARTS * 8], 0);
        RandomKey { bytes, len }.number(seed)
    }

    /// A key of all these parts, the run's seed first.
    #[inline]
    pub(crate) fn of<const PARTS: usize>(parts: [u64; PARTS]) -> Self {
        const { assert!(PARTS <= MAX_PARTS) };
        let mut bytes = [0; MAX_PARTS * 8];
        for (place, part) in bytes.chunks_exact_mut(8).zip(parts) {
            place.copy_from_slice(&part.to_le_bytes());
        }
        let len = PARTS * 8;
        RandomKey { bytes, len }
    }

    /// Adds a name.
    #[inline]
    pub fn text(self, text: &str) -> Self {
        self.number(xxh3_64(text.as_bytes()))
    }

    /// Adds a number, or a name hashed before by [`name_hash`].
    ///
    /// # Panics
    /// When the key has 12 parts already: a bug in the caller.
    #[inline]
    pub fn number(mut self, number: u64) -> Self {
        self.bytes[self.len..self.len + 8].copy_from_slice(&number.to_le_bytes());
        self.len += 8;
        self
    }

    /// The 128 bits that the key hashes to.
    #[inline]
    pub fn hash(&self) -> u128 {
        xxh3_128(&self.bytes[..self.len])
    }

    /// The stream at this address, at its beginning.
    #[inline]
    pub fn stream(&self) -> Stream {
        let hash = self.hash();
        // Which of the generator's streams it is; any fixed mix of the hash will do.
        let mix = hash.rotate_left(64).wrapping_mul(0x9E37_79B9);
        Stream(Pcg64::new(hash, mix >> 1))
    }

    /// One uniform draw from [0, 1) at this address, without building a stream: what a link that
    /// asks a single question of a message wants.
    #[inline]
    pub fn uniform(&self) -> f64 {
        unit_interval(self.hash() as u64)
    }
}

/// The hash under which a name enters a [`RandomKey`], for callers that keep it.
///
/// ```
/// use farside::random::{RandomKey, name_hash};
/// let kept = name_hash("rover_1");
/// assert_eq!(RandomKey::new(1).number(kept).hash(), RandomKey::new(1).text("rover_1").hash());
/// ```
pub fn name_hash(name: &str) -> u64 {
    xxh3_64(name.as_bytes())
}

fn unit_interval(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// A stream of random draws, with samplers whose results are pinned by golden vectors.
///
/// ```
/// use farside::random::RandomKey;
/// let mut stream = RandomKey::new(1).text("doc").stream();
/// let die = 1 + stream.below(6);
/// assert!((1..=6).contains(&die));
/// let wait_s = stream.exponential(2.0);
/// assert!(wait_s >= 0.0);
/// ```
#[derive(Clone, Debug)]
pub struct Stream(Pcg64);

impl Stream {
    /// 64 random bits.
    #[inline]
    pub fn next_u64(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Uniform in [0, 1), with 53 random bits.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        unit_interval(self.next_u64())
    }

    /// Uniform in [low, high).
    #[inline]
    pub fn uniform_in(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform over 0, 1, ..., `n - 1`, without bias (Lemire's method).
    ///
    /// # Panics
    /// When `n` is zero: there is nothing to draw from.
    #[inline]
    pub fn below(&mut self, n: u64) -> u64 {
        assert!(n > 0, "a draw below zero has no values");
        loop {
            let wide = u128::from(self.next_u64()) * u128::from(n);
            let low = wide as u64;
            // The division decides only draws in the last, incomplete stretch: hardly ever needed.
            if low >= n || low >= n.wrapping_neg() % n {
                return (wide >> 64) as u64;
            }
        }
    }

    /// True with the given probability; 0 never, 1 always.
    #[inline]
    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Exponential with the given mean (the ziggurat of Marsaglia and Tsang, *The Ziggurat Method
    /// for Generating Random Variables*, 2000: one draw and no logarithm in 98.9 % of the calls).
    #[inline]
    pub fn exponential(&mut self, mean: f64) -> f64 {
        mean * ziggurat::exponential(self)
    }

    /// Normal with the given mean and standard deviation (Box-Muller, one of the pair, so that
    /// every call takes two draws and none is kept back).
    pub fn normal(&mut self, mean: f64, standard_deviation: f64) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        let angle = 2.0 * std::f64::consts::PI * self.uniform();
        mean + standard_deviation * radius * libm::cos(angle)
    }

    /// Puts `items` in uniformly random order (Fisher-Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last as u64 + 1) as usize);
        }
    }

    /// One of `items`, or `None` if there are none.
    pub fn choose<'a, T>(&mut self, items: &'a [T]) -> Option<&'a T> {
        if items.is_empty() {
            return None;
        }
        items.get(self.below(items.len() as u64) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream() -> Stream {
        RandomKey::new(42).text("golden").number(3).stream()
    }

    #[test]
    fn golden_vectors() {
        let mut s = stream();
        let bits: Vec<u64> = (0..3).map(|_| s.next_u64()).collect();
        assert_eq!(
            bits,
            [
                10210219695074858813,
                5852600452983497931,
                11338518418372744125
            ]
        );
        let mut s = stream();
        assert_eq!(s.below(1000), 553);
        assert_eq!(s.uniform(), 0.3172701062907177);
        assert_eq!(s.exponential(2.0), 1.2071562843991024);
        assert_eq!(s.normal(1.0, 2.0), -0.8770102719010568);
        let mut order: Vec<u8> = (0..8).collect();
        s.shuffle(&mut order);
        assert_eq!(order, [6, 0, 1, 5, 4, 7, 2, 3]);
        assert_eq!(RandomKey::new(42).text("x").uniform(), 0.9998815307358532);
    }

    #[test]
    fn moments_match_their_closed_forms() {
        let mut s = stream();
        let n = 200_000;
        let mean = |f: &mut dyn FnMut() -> f64| (0..n).map(|_| f()).sum::<f64>() / f64::from(n);
        assert!((mean(&mut || s.uniform()) - 0.5).abs() < 0.005);
        assert!((mean(&mut || s.exponential(3.0)) - 3.0).abs() < 0.05);
        assert!((mean(&mut || s.normal(-1.0, 2.0)) + 1.0).abs() < 0.03);
        let second = mean(&mut || {
            let x = s.normal(0.0, 2.0);
            x * x
        });
        assert!((second - 4.0).abs() < 0.08);
        assert!((mean(&mut || s.below(7) as f64) - 3.0).abs() < 0.03);
    }

    #[test]
    fn a_key_of_parts_is_one_that_they_were_added_to() {
        let all = RandomKey::of([1, 2, 3]);
        assert_eq!(all.hash(), RandomKey::new(1).number(2).number(3).hash());
        assert_eq!(all.number(4).hash(), RandomKey::of([1, 2, 3, 4]).hash());
    }

    #[test]
    fn every_part_of_a_key_matters() {
        let base = RandomKey::new(1).text("a").number(2);
        let others = [
            RandomKey::new(2).text("a").number(2),
            RandomKey::new(1).text("b").number(2),
            RandomKey::new(1).text("a").number(3),
            RandomKey::new(1).text("a"),
        ];
        for other in others {
            assert_ne!(base.hash(), other.hash());
        }
    }

    #[test]
    fn chance_is_certain_at_its_ends() {
        let mut s = stream();
        assert!((0..1000).all(|_| !s.chance(0.0) && s.chance(1.0)));
    }
}
