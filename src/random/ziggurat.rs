//! A ziggurat for the exponential distribution: 256 layers of equal area under e^-x.
//!
//! The tables follow from two constants and `libm`, so they are the same on every machine.

use std::sync::OnceLock;

use super::Stream;

const LAYERS: usize = 256;
/// Where the lowest layer's tail begins.
const TAIL: f64 = 7.697_117_470_131_05;
/// The area of each layer, the lowest with its tail.
const AREA: f64 = 3.949_659_822_581_557e-3;

struct Tables {
    /// Right edges of the layers, from the lowest, whose edge stands in for its tail, up to 0.
    x: [f64; LAYERS + 1],
    /// The density at those edges.
    density: [f64; LAYERS + 1],
}

fn tables() -> &'static Tables {
    static TABLES: OnceLock<Tables> = OnceLock::new();
    TABLES.get_or_init(|| {
        let mut x = [0.0; LAYERS + 1];
        x[0] = AREA * libm::exp(TAIL);
        x[1] = TAIL;
        for layer in 2..LAYERS {
            let below = x[layer - 1];
            x[layer] = -libm::log(AREA / below + libm::exp(-below));
        }
        Tables {
            density: x.map(|edge| libm::exp(-edge)),
            x,
        }
    })
}

/// One draw with mean 1.
pub(super) fn exponential(stream: &mut Stream) -> f64 {
    let Tables { x, density } = tables();
    loop {
        let bits = stream.next_u64();
        // The low byte picks the layer, the high 53 bits the place in it.
        let layer = (bits & 0xFF) as usize;
        let at = super::unit_interval(bits) * x[layer];
        if at < x[layer + 1] {
            return at;
        }
        if layer == 0 {
            // The tail of an exponential is the exponential again.
            return TAIL - libm::log(1.0 - stream.uniform());
        }
        let height = density[layer] + (density[layer + 1] - density[layer]) * stream.uniform();
        if height < libm::exp(-at) {
            return at;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomKey;

    #[test]
    fn layers_have_equal_areas_and_end_at_zero() {
        let Tables { x, density } = tables();
        for layer in 1..LAYERS {
            let area = x[layer] * (density[layer + 1] - density[layer]);
            assert!((area - AREA).abs() < 1e-12, "layer {layer}: {area}");
        }
        assert_eq!(x[LAYERS], 0.0);
    }

    /// The empirical distribution function against 1 - e^-x, at a distance that 10^6 draws exceed
    /// once in a thousand times (Kolmogorov-Smirnov), and the tail by its own mass.
    #[test]
    fn follows_the_exponential_distribution() {
        let mut stream = RandomKey::new(3).text("ziggurat").stream();
        let count = 1_000_000;
        let mut draws: Vec<f64> = (0..count).map(|_| exponential(&mut stream)).collect();
        draws.sort_by(f64::total_cmp);
        let n = f64::from(count);
        let mut worst = 0.0f64;
        for (rank, draw) in draws.iter().enumerate() {
            worst = worst.max(((rank as f64 + 0.5) / n - (1.0 - libm::exp(-draw))).abs());
        }
        assert!(worst < 1.95 / libm::sqrt(n), "distance {worst}");
        let tail = draws.iter().filter(|draw| **draw > TAIL).count() as f64;
        let expected = n * libm::exp(-TAIL);
        assert!(
            (tail - expected).abs() < 4.0 * libm::sqrt(expected),
            "{tail} in the tail"
        );
    }
}
