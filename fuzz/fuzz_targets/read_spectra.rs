//! Reads any bytes as a library of spectra. Whatever the bytes, there is an error that names a line
//! of the file, or a library whose samples are whole, and of which a rock field can be made.
#![no_main]

use std::sync::Arc;

use farside_worlds::spectra::{MAX_REFLECTANCE, SpectralLibrary};
use farside_worlds::{FieldClasses, FieldRocks, FieldSpectra, RockField, RockFieldSettings};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match SpectralLibrary::from_csv(bytes) {
        Ok(library) => {
            assert!(!library.is_empty() && !library.minerals().is_empty());
            assert!(library.wavelengths_nm().is_sorted_by(|a, b| 0.0 < *a && a < b));
            for sample in library.samples() {
                let sum: f64 = sample.fractions.iter().sum();
                assert!((sum - 1.0).abs() < 1e-9, "{}: {sum}", sample.id);
                let mut values = sample.reflectance.iter();
                assert!(values.all(|value| (0.0..=MAX_REFLECTANCE).contains(value)));
            }
            field_of(library);
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            let lines = bytes.iter().filter(|byte| **byte == b'\n').count() + 1;
            assert!(error.line().is_none_or(|line| (1..=lines).contains(&line)), "{error}");
        }
    }
});

/// A field of ten rocks of one class, which every library has.
fn field_of(library: SpectralLibrary) {
    let settings = RockFieldSettings {
        classes: FieldClasses::Count(1),
        rocks: FieldRocks::Exactly(10),
        resolution_m: 10.0,
        spectra: FieldSpectra::Library(Arc::new(library)),
        ..RockFieldSettings::default()
    };
    let field = RockField::generate(&settings).expect("a library has a sample");
    assert_eq!(field.ground_reflectance().len(), field.wavelengths_nm().len());
    assert!(field.ground_reflectance().iter().all(|value| value.is_finite()));
    assert!((0..10).all(|rock| field.truth().rock(rock).class == 0));
}
