//! The classes of a field, and where the spectra of their rocks come from.

use farside::random::RandomKey;

use super::settings::{FieldClasses, FieldSpectra, RockFieldSettings};
use crate::geology::{GeologyError, MAX_CLASSES, RockClass};
use crate::spectra::{MINERALS, SpectralLibrary};

/// The classes of a field over its minerals.
pub(super) struct Palette {
    pub(super) classes: Vec<RockClass>,
    pub(super) minerals: Vec<String>,
    /// With a library, the samples of each class.
    pub(super) samples: Vec<Vec<u32>>,
}

impl Palette {
    pub(super) fn of(
        settings: &RockFieldSettings,
        key: RandomKey,
    ) -> Result<Palette, GeologyError> {
        match &settings.spectra {
            FieldSpectra::Mixed => mixed(&settings.classes, key),
            FieldSpectra::Library(library) => measured(&settings.classes, library),
        }
    }
}

fn mixed(classes: &FieldClasses, key: RandomKey) -> Result<Palette, GeologyError> {
    let classes = match classes {
        FieldClasses::Custom(classes) => classes.clone(),
        FieldClasses::Named(names) => {
            let named = names.iter().map(|name| RockClass::builtin(name));
            named.collect::<Result<_, _>>()?
        }
        FieldClasses::Count(count) => {
            let mut places: Vec<usize> = (0..RockClass::builtin_names().len()).collect();
            if !(1..=places.len()).contains(count) {
                return Err(GeologyError::ClassCount {
                    most: places.len(),
                    actual: *count,
                });
            }
            key.text("classes").stream().shuffle(&mut places);
            places.truncate(*count);
            places.sort_unstable();
            let names = RockClass::builtin_names().enumerate();
            let chosen = names.filter(|(place, _)| places.contains(place));
            chosen
                .map(|(_, name)| RockClass::builtin(name))
                .collect::<Result<_, _>>()?
        }
    };
    check(&classes, MINERALS.len())?;
    Ok(Palette {
        classes,
        minerals: MINERALS.map(str::to_owned).to_vec(),
        samples: Vec::new(),
    })
}

/// How many classes, their names and figures.
fn check(classes: &[RockClass], minerals: usize) -> Result<(), GeologyError> {
    if !(1..=MAX_CLASSES).contains(&classes.len()) {
        return Err(GeologyError::ClassCount {
            most: MAX_CLASSES,
            actual: classes.len(),
        });
    }
    for (place, class) in classes.iter().enumerate() {
        class.check(minerals)?;
        if classes[..place]
            .iter()
            .any(|other| other.name == class.name)
        {
            let name = class.name.clone();
            return Err(GeologyError::DuplicateClass { name });
        }
    }
    Ok(())
}

/// A group for each mineral that dominates a sample.
fn measured(classes: &FieldClasses, library: &SpectralLibrary) -> Result<Palette, GeologyError> {
    let minerals = library.minerals();
    let mut groups: Vec<Vec<u32>> = vec![Vec::new(); minerals.len()];
    for (sample, number) in library.samples().zip(0..) {
        groups[sample.dominant_mineral()].push(number);
    }
    let there: Vec<usize> = (0..minerals.len())
        .filter(|&mineral| !groups[mineral].is_empty())
        .collect();
    let chosen = match classes {
        FieldClasses::Custom(_) => return Err(GeologyError::CustomWithLibrary),
        FieldClasses::Named(names) => {
            let find = |name: &String| {
                let found = there.iter().find(|&&mineral| minerals[mineral] == *name);
                let names = there.iter().map(|&mineral| minerals[mineral].as_str());
                found
                    .copied()
                    .ok_or_else(|| GeologyError::unknown_class(name, names))
            };
            names.iter().map(find).collect::<Result<Vec<_>, _>>()?
        }
        FieldClasses::Count(count) => {
            if !(1..=there.len()).contains(count) {
                return Err(GeologyError::ClassCount {
                    most: there.len(),
                    actual: *count,
                });
            }
            // The largest groups; of equal ones the first.
            let mut chosen = there.clone();
            chosen.sort_by_key(|&mineral| usize::MAX - groups[mineral].len());
            chosen.truncate(*count);
            chosen.sort_unstable();
            chosen
        }
    };
    let class = |&mineral: &usize| {
        let samples = &groups[mineral];
        let mut fractions = vec![0.0; minerals.len()];
        for &sample in samples {
            let sample = library.sample(sample as usize);
            for (mean, fraction) in fractions.iter_mut().zip(sample.fractions) {
                *mean += fraction / samples.len() as f64;
            }
        }
        RockClass::measured(minerals[mineral].clone(), fractions, mineral)
    };
    let classes: Vec<RockClass> = chosen.iter().map(class).collect();
    check(&classes, minerals.len())?;
    Ok(Palette {
        classes,
        minerals: minerals.to_vec(),
        samples: chosen
            .iter()
            .map(|&mineral| groups[mineral].clone())
            .collect(),
    })
}
