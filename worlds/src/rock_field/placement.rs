//! Where the rocks of a field lie: places first, then sizes as the story moves them, then apart.

use farside::random::{RandomKey, Stream};
use nalgebra::Point2;

use super::settings::{FieldRocks, MAX_FIELD_ROCKS, RockFieldSettings};
use crate::error::TerrainError;
use crate::geology::{GeologyError, Story};
use crate::rocks::{MAX_DIAMETER_M, Rock, RockAbundance};

/// The smallest rocks there are \[m\].
const LEAST_DIAMETER_M: f64 = 0.01;

/// How often a rock that lies on another is moved before it stays there.
const MOVES: usize = 16;

/// The rocks, in no particular order.
pub(super) fn rocks(
    settings: &RockFieldSettings,
    story: &Story,
    key: RandomKey,
) -> Result<Vec<Rock>, GeologyError> {
    let mut stream = key.text("rocks").stream();
    let mut rocks = drawn(settings, &mut stream)?;
    move_sizes(&mut rocks, story, &mut key.text("sizes").stream());
    move_apart(&mut rocks, settings, &mut key.text("apart").stream());
    Ok(rocks)
}

/// Rocks whose sizes and places know nothing of each other.
fn drawn(settings: &RockFieldSettings, stream: &mut Stream) -> Result<Vec<Rock>, GeologyError> {
    let half_m = 0.5 * settings.side_m;
    let area_m2 = settings.side_m * settings.side_m;
    let abundance = RockAbundance::new(settings.abundance)?;
    match settings.rocks {
        FieldRocks::FromDiameter(least_m) => {
            let expected = abundance.per_m2(least_m) * area_m2;
            if expected > MAX_FIELD_ROCKS as f64 {
                let limit = MAX_FIELD_ROCKS as f64;
                return Err(TerrainError::TooManyRocks { limit, expected }.into());
            }
            let (low_m, high_m) = (Point2::new(-half_m, -half_m), Point2::new(half_m, half_m));
            Ok(abundance.draw(low_m, high_m, least_m, stream)?)
        }
        FieldRocks::Exactly(count) => {
            let least_m = least_of_largest_m(&abundance, count as f64 / area_m2, area_m2)?;
            let draw = |_| Rock {
                position_m: Point2::new(
                    stream.uniform_in(-half_m, half_m),
                    stream.uniform_in(-half_m, half_m),
                ),
                diameter_m: abundance.draw_diameter_m(least_m, stream),
            };
            Ok((0..count).map(draw).collect())
        }
    }
}

/// The diameter above which so many rocks are to be expected on each square metre.
fn least_of_largest_m(
    abundance: &RockAbundance,
    per_m2: f64,
    area_m2: f64,
) -> Result<f64, GeologyError> {
    let most = abundance.per_m2(LEAST_DIAMETER_M);
    if per_m2 > most {
        return Err(GeologyError::Setting {
            setting: "rocks",
            least: 1.0,
            most: libm::floor(most * area_m2),
            actual: per_m2 * area_m2,
        });
    }
    let (mut low_m, mut high_m) = (LEAST_DIAMETER_M, MAX_DIAMETER_M);
    for _ in 0..40 {
        let middle_m = 0.5 * (low_m + high_m);
        match abundance.per_m2(middle_m) > per_m2 {
            true => low_m = middle_m,
            false => high_m = middle_m,
        }
    }
    Ok(low_m)
}

/// Gives the sizes to the places as the story has it. There are as many of each size as before.
fn move_sizes(rocks: &mut [Rock], story: &Story, stream: &mut Stream) {
    let correlation = story.size_correlation();
    if correlation == 0.0 {
        return;
    }
    let mut scores = story.standard_size_trends(rocks.iter().map(|rock| rock.position_m));
    let rest = libm::sqrt(1.0 - correlation * correlation);
    for score in &mut scores {
        *score = correlation * *score + stream.normal(0.0, rest);
    }
    let mut places: Vec<usize> = (0..rocks.len()).collect();
    places.sort_by(|&a, &b| scores[a].total_cmp(&scores[b]));
    let mut diameters_m: Vec<f64> = rocks.iter().map(|rock| rock.diameter_m).collect();
    diameters_m.sort_by(f64::total_cmp);
    for (place, diameter_m) in places.into_iter().zip(diameters_m) {
        rocks[place].diameter_m = diameter_m;
    }
}

/// Moves rocks that lie on larger ones, or in the clear around the middle, to a free place nearby.
fn move_apart(rocks: &mut [Rock], settings: &RockFieldSettings, stream: &mut Stream) {
    let half_m = 0.5 * settings.side_m;
    let mut by_size: Vec<usize> = (0..rocks.len()).collect();
    by_size.sort_by(|&a, &b| rocks[b].diameter_m.total_cmp(&rocks[a].diameter_m));
    // Buckets as wide as the largest rock: whatever touches a rock lies in one of nine.
    let buckets = libm::ceil(settings.side_m / MAX_DIAMETER_M) as usize;
    let bucket =
        |coordinate_m: f64| (((coordinate_m + half_m) / MAX_DIAMETER_M) as usize).min(buckets - 1);
    let mut placed: Vec<Vec<Rock>> = vec![Vec::new(); buckets * buckets];
    // Where rocks cover most of the ground, there is no free place for all of them.
    let mut moves_left = 1000 + 4 * rocks.len();
    for index in by_size {
        let home_m = rocks[index].position_m;
        let mut rock = rocks[index];
        for moves in 1..=MOVES {
            let is_free = rock.position_m.coords.norm()
                >= settings.clear_radius_m + 0.5 * rock.diameter_m
                && neighbours(
                    bucket(rock.position_m.x),
                    bucket(rock.position_m.y),
                    buckets,
                )
                .all(|at| {
                    placed[at].iter().all(|other| {
                        let apart_m = 0.5 * (rock.diameter_m + other.diameter_m);
                        (other.position_m - rock.position_m).norm() >= apart_m
                    })
                });
            if is_free || moves_left == 0 {
                break;
            }
            moves_left -= 1;
            // Farther with each attempt, and farther for those that must leave the clear.
            let reach_m = moves as f64 * (0.5 * rock.diameter_m + 0.25 * settings.clear_radius_m);
            let mut moved =
                |home_m: f64| (home_m + stream.normal(0.0, reach_m)).clamp(-half_m, half_m);
            rock.position_m = Point2::new(moved(home_m.x), moved(home_m.y));
        }
        rocks[index] = rock;
        placed[bucket(rock.position_m.y) * buckets + bucket(rock.position_m.x)].push(rock);
    }
}

/// The buckets around one, itself included.
fn neighbours(column: usize, row: usize, buckets: usize) -> impl Iterator<Item = usize> {
    let around = move |at: usize| at.saturating_sub(1)..=(at + 1).min(buckets - 1);
    around(row).flat_map(move |row| around(column).map(move |column| row * buckets + column))
}
