//! Classes in distribution, stories where they should be, and what is refused.

use farside::random::{RandomKey, Stream};
use nalgebra::Point2;
use proptest::prelude::*;

use super::*;
use crate::rocks::Rock;
use crate::spectra::MINERALS;

fn stream(seed: u64) -> Stream {
    RandomKey::new(seed).text("geology").stream()
}

/// Mean and standard deviation.
fn moments(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values
        .iter()
        .map(|value| (value - mean) * (value - mean))
        .sum();
    (mean, libm::sqrt(squares / count))
}

#[test]
fn rocks_of_a_class_are_as_the_class_says() {
    for name in RockClass::builtin_names() {
        let class = RockClass::builtin(name).unwrap();
        class.check(MINERALS.len()).unwrap();
        let mut stream = stream(1);
        let (mut fractions, mut samples) = (Vec::new(), Vec::new());
        for _ in 0..4000 {
            class.draw_fractions(&mut stream, &mut fractions);
            samples.push(class.draw(&mut stream));
        }
        for mineral in 0..MINERALS.len() {
            let of_mineral: Vec<f64> = fractions
                .iter()
                .skip(mineral)
                .step_by(MINERALS.len())
                .copied()
                .collect();
            let (mean, deviation) = moments(&of_mineral);
            let said = class.fractions[mineral];
            assert!(
                (mean - said).abs() < 0.01,
                "{name}, {mineral}: {mean} for {said}"
            );
            assert!(
                deviation < 0.25 * said,
                "{name}, {mineral}: scatters by {deviation}"
            );
        }
        for place in 0..TEXTURE {
            let values: Vec<f64> = samples.iter().map(|sample| sample.texture[place]).collect();
            let (mean, deviation) = moments(&values);
            let (said, scatter) = (class.texture[place], class.texture_scatter[place]);
            assert!(
                (mean - said).abs() < 0.1 * scatter,
                "{name}, {place}: {mean} for {said}"
            );
            assert!(
                (deviation / scatter - 1.0).abs() < 0.1,
                "{name}, {place}: {deviation} for {scatter}"
            );
        }
        let logs: Vec<f64> = samples
            .iter()
            .map(|sample| libm::log(sample.grain_um))
            .collect();
        let (mean, deviation) = moments(&logs);
        assert!((mean - libm::log(class.grain_um)).abs() < 0.03 && (deviation - 0.25).abs() < 0.03);
    }
}

#[test]
fn a_class_that_cannot_be_is_refused() {
    let good = || RockClass::builtin("norite").unwrap();
    let check = |class: RockClass, expected: &str| {
        assert_eq!(
            class.check(MINERALS.len()).unwrap_err().to_string(),
            expected
        );
    };
    let mut class = good();
    class.fractions[0] += 0.1;
    check(
        class,
        "the fractions of the class \"norite\" sum to 1.1; expected 1",
    );
    let mut class = good();
    class.fractions[0] = f64::NAN;
    check(
        class,
        "fractions of the class \"norite\" must be within 0 and 1; it is NaN",
    );
    let mut class = good();
    class.fractions.pop();
    check(
        class,
        "the class \"norite\" has 4 fractions; expected 5, one for each mineral",
    );
    let mut class = good();
    class.grain_um = 0.0;
    check(
        class,
        "grain_um of the class \"norite\" must be within 5 and 5000; it is 0",
    );
    let mut class = good();
    class.texture[2] = -1.5;
    check(
        class,
        "correlation of the class \"norite\" must be within -1 and 1; it is -1.5",
    );
    let error = RockClass::builtin("noryte").unwrap_err().to_string();
    assert!(
        error.contains("did you mean \"norite\"? There are olivine_basalt, dunite"),
        "{error}"
    );
}

/// Rocks at random places, each with the class that the story gives it.
fn laid_out(story: &Story, rocks: usize, stream: &mut Stream) -> (Vec<Rock>, Vec<usize>) {
    let mut shares = vec![0.0; story.classes()];
    let draw = |_| {
        let position_m = Point2::new(
            stream.uniform_in(-50.0, 50.0),
            stream.uniform_in(-50.0, 50.0),
        );
        let rock = Rock {
            position_m,
            diameter_m: stream.uniform_in(0.3, 2.0),
        };
        story.class_probabilities(position_m, rock.diameter_m, &mut shares);
        let mut left = stream.uniform();
        let class = shares.iter().position(|share| {
            left -= share;
            left < 0.0
        });
        (rock, class.unwrap_or(story.classes() - 1))
    };
    (0..rocks).map(draw).unzip()
}

/// The share of rocks whose nearest neighbour is of their class, over what it is expected to be if
/// classes were shuffled.
fn togetherness(rocks: &[Rock], classes: &[usize]) -> f64 {
    let same = (0..rocks.len()).filter(|&i| {
        let others = (0..rocks.len()).filter(|&j| j != i);
        let distance = |j: usize| (rocks[j].position_m - rocks[i].position_m).norm();
        let nearest = others.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        nearest.is_some_and(|j| classes[j] == classes[i])
    });
    let counts = classes.iter().fold([0.0f64; 8], |mut counts, &class| {
        counts[class] += 1.0;
        counts
    });
    let count = rocks.len() as f64;
    let expected: f64 = counts
        .iter()
        .map(|of| of * (of - 1.0) / (count - 1.0))
        .sum();
    same.count() as f64 / expected.max(1.0)
}

#[test]
fn each_story_lays_its_classes_out_in_its_way() {
    let mean = |kind| {
        let fields = (0..30).map(|seed| {
            let mut stream = stream(seed);
            let story = Story::draw(kind, 4, 100.0, &mut stream);
            let (rocks, classes) = laid_out(&story, 200, &mut stream);
            togetherness(&rocks, &classes)
        });
        fields.sum::<f64>() / 30.0
    };
    let uniform = mean(StoryKind::Uniform);
    assert!((uniform - 1.0).abs() < 0.06, "uniform {uniform}");
    for (kind, least) in [
        (StoryKind::Strata, 1.8),
        (StoryKind::Ejecta, 1.3),
        (StoryKind::Lava, 1.5),
        (StoryKind::Outwash, 1.15),
    ] {
        let together = mean(kind);
        assert!(together > least, "{}: {together}", kind.name());
    }
}

/// The mean of a class's probability over circles, rings or bands says where the story puts it.
#[test]
fn ejecta_lie_in_shells_around_the_crater_with_large_blocks_near_it() {
    for seed in 0..20 {
        let story = Story::draw(StoryKind::Ejecta, 4, 100.0, &mut stream(seed));
        // The crater is where rocks are largest.
        let grid = (-50..=50)
            .flat_map(|x| (-50..=50).map(move |y| Point2::new(f64::from(x), f64::from(y))));
        let center = grid
            .max_by(|a, b| story.size_trend(*a).total_cmp(&story.size_trend(*b)))
            .unwrap();
        let mut shares = [0.0; 4];
        story.class_probabilities(center, 0.5, &mut shares);
        let deepest = (0..4)
            .max_by(|&a, &b| shares[a].total_cmp(&shares[b]))
            .unwrap();
        let mut before = shares[deepest];
        assert!(before > 0.6, "{shares:?}");
        let out = -center.coords / center.coords.norm().max(1.0);
        for step in 1..=30 {
            let place = center + out * (f64::from(step) * 3.0);
            story.class_probabilities(place, 0.5, &mut shares);
            assert!(shares[deepest] <= before + 1e-12);
            before = shares[deepest];
        }
        assert!(before < 0.1, "the deepest rock lies {before} far out");
    }
}

#[test]
fn outwash_loses_weak_rocks_and_large_ones_on_the_way() {
    let story = Story::draw(StoryKind::Outwash, 3, 100.0, &mut stream(3));
    let up = (0..360)
        .map(|degree| {
            let (sine, cosine) = libm::sincos(f64::from(degree).to_radians());
            Point2::new(50.0 * cosine, 50.0 * sine)
        })
        .max_by(|a, b| story.size_trend(*a).total_cmp(&story.size_trend(*b)))
        .unwrap();
    let share = |place: Point2<f64>, diameter_m: f64| {
        let mut shares = [0.0; 3];
        story.class_probabilities(place, diameter_m, &mut shares);
        shares
    };
    let (above, below) = (share(up, 0.5), share(-up, 0.5));
    let strongest = (0..3)
        .max_by(|&a, &b| below[a].total_cmp(&below[b]))
        .unwrap();
    assert!(
        below[strongest] > above[strongest] + 0.3,
        "{above:?} {below:?}"
    );
    assert!(share(up, 2.0)[strongest] > above[strongest]);
}

#[test]
fn a_name_that_is_no_story_names_the_nearest() {
    for kind in StoryKind::ALL {
        assert_eq!(kind.name().parse::<StoryKind>(), Ok(kind));
    }
    let error = "starta".parse::<StoryKind>().unwrap_err().to_string();
    assert_eq!(
        error,
        "there is no story \"starta\"; did you mean \"strata\"? There are strata, ejecta, lava, outwash, uniform"
    );
}

proptest! {
    /// Whatever the place, probabilities are shares of one, and none is a number that is not.
    #[test]
    fn probabilities_sum_to_one(
        seed in any::<u64>(),
        kind in 0usize..5,
        classes in 1usize..9,
        (x_m, y_m) in (-1e4..1e4f64, -1e4..1e4f64),
        diameter_m in 0.0..10.0f64,
    ) {
        let story = Story::draw(StoryKind::ALL[kind], classes, 100.0, &mut stream(seed));
        let mut shares = vec![f64::NAN; classes];
        story.class_probabilities(Point2::new(x_m, y_m), diameter_m, &mut shares);
        prop_assert!(shares.iter().all(|share| (0.0..=1.0).contains(share)), "{shares:?}");
        prop_assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        prop_assert!(story.size_trend(Point2::new(x_m, y_m)).is_finite());
        let rock = Rock { position_m: Point2::new(x_m, y_m), diameter_m };
        let evidence = Evidence::new(&[rock], classes, &shares);
        prop_assert!(story.log_likelihood(&evidence).is_finite());
    }

    /// Fractions that are drawn sum to 1, and a mineral that a class lacks, its rocks lack.
    #[test]
    fn drawn_fractions_are_a_whole(
        parts in prop::collection::vec(0.0..1.0f64, 5),
        lacking in 0usize..5,
        scatter in 0.0..=1.0f64,
        seed in any::<u64>(),
    ) {
        let mut class = RockClass::builtin("norite").unwrap();
        class.fractions = parts;
        class.fractions[lacking] = 0.0;
        let sum: f64 = class.fractions.iter().sum();
        prop_assume!(sum > 0.1);
        class.fractions.iter_mut().for_each(|fraction| *fraction /= sum);
        class.scatter = scatter;
        class.check(5).unwrap();
        let mut drawn = Vec::new();
        class.draw_fractions(&mut stream(seed), &mut drawn);
        prop_assert!((drawn.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        prop_assert_eq!(drawn[lacking], 0.0);
        prop_assert!(drawn.iter().all(|fraction| (0.0..=1.0).contains(fraction)));
    }
}
