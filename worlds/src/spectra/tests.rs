//! Where bands lie, what grains and dust do to them, and what a library's reader refuses.

use proptest::prelude::*;

use super::*;

const BANDS: usize = 101;

/// A rock of one mineral.
fn pure(mineral: usize, grain_um: f64, dust: f64) -> Vec<f64> {
    let mut fractions = [0.0; MINERALS.len()];
    fractions[mineral] = 1.0;
    mixed(&fractions, grain_um, dust)
}

fn mixed(fractions: &[f64], grain_um: f64, dust: f64) -> Vec<f64> {
    let mut out = vec![0.0; BANDS];
    SpectralModel::new(&wavelength_grid_nm()).reflectance_into(fractions, grain_um, dust, &mut out);
    out
}

/// How deep a band is under the straight line between its shoulders.
fn depth(spectrum: &[f64], from_nm: f64, center_nm: f64, to_nm: f64) -> f64 {
    let at = |nm: f64| spectrum[((nm - 450.0) / 20.0) as usize];
    let share = (center_nm - from_nm) / (to_nm - from_nm);
    let shoulder = at(from_nm) + share * (at(to_nm) - at(from_nm));
    1.0 - at(center_nm) / shoulder
}

/// The wavelength \[nm\] at which a spectrum is lowest under the line between two shoulders.
fn band_nm(spectrum: &[f64], from_nm: f64, to_nm: f64) -> f64 {
    let inside = wavelength_grid_nm()
        .into_iter()
        .filter(|nm| (from_nm..=to_nm).contains(nm));
    let deepest = inside.max_by(|&a, &b| {
        depth(spectrum, from_nm, a, to_nm).total_cmp(&depth(spectrum, from_nm, b, to_nm))
    });
    deepest.expect("the range has bands")
}

#[test]
fn bands_lie_where_the_minerals_have_them() {
    let near = |mineral, [from_nm, to_nm]: [f64; 2], [least_nm, most_nm]: [f64; 2]| {
        let found_nm = band_nm(&pure(mineral, 60.0, 0.0), from_nm, to_nm);
        let name = MINERALS[mineral];
        assert!(
            (least_nm..=most_nm).contains(&found_nm),
            "{name}: {found_nm} nm"
        );
    };
    near(0, [650.0, 1650.0], [1030.0, 1080.0]);
    near(1, [650.0, 1250.0], [890.0, 940.0]);
    near(1, [1250.0, 2450.0], [1800.0, 1950.0]);
    near(2, [650.0, 1450.0], [970.0, 1050.0]);
    near(2, [1450.0, 2450.0], [2090.0, 2310.0]);
    near(3, [850.0, 1750.0], [1210.0, 1290.0]);
    // Hematite tints: in a tenth of it, its two bands show.
    let tinted = mixed(&[0.0, 0.0, 0.0, 0.97, 0.03], 60.0, 0.0);
    let found_nm = band_nm(&tinted, 750.0, 1050.0);
    assert!(
        (830.0..=890.0).contains(&found_nm),
        "hematite: {found_nm} nm"
    );
    let plain = mixed(&[0.0, 0.0, 0.0, 1.0, 0.0], 60.0, 0.0);
    let edge = |spectrum: &[f64]| spectrum[15] / spectrum[4];
    assert!(
        edge(&tinted) > 1.1 * edge(&plain),
        "{} and {}",
        edge(&tinted),
        edge(&plain)
    );
}

#[test]
fn coarse_grains_are_dark_and_bands_deepen_until_they_saturate() {
    let depths: Vec<f64> = [20.0, 60.0, 200.0, 600.0, 3000.0]
        .iter()
        .map(|&grain_um| depth(&pure(1, grain_um, 0.0), 710.0, 910.0, 1250.0))
        .collect();
    assert!(depths[0] < depths[1] && depths[1] < depths[2], "{depths:?}");
    assert!(depths[4] < depths[2], "{depths:?}");
    let albedo = |grain_um| pure(1, grain_um, 0.0).iter().sum::<f64>();
    assert!(albedo(20.0) > albedo(60.0) && albedo(60.0) > albedo(600.0));
}

#[test]
fn dust_reddens_and_hides_bands() {
    let (clean, dusty) = (pure(0, 150.0, 0.0), pure(0, 150.0, 0.6));
    let band = |spectrum: &[f64]| depth(spectrum, 650.0, 1050.0, 1650.0);
    assert!(band(&dusty) < band(&clean) - 0.1);
    let red = |spectrum: &[f64]| spectrum[15] / spectrum[2];
    assert!(red(&dusty) > red(&clean));
    let model = SpectralModel::new(&wavelength_grid_nm());
    assert_eq!(pure(0, 150.0, 1.0), model.dust());
    // As bright as Mars's dust (Bell and others, 2000): dark in the blue, bright from 750 nm on.
    let dust = model.dust();
    assert!(
        (0.05..0.12).contains(&dust[0]) && (0.2..0.4).contains(&dust[15]),
        "{dust:?}"
    );
}

/// A library of three bands, with one line replaced.
fn library(line: usize, text: &str) -> Result<SpectralLibrary, LibraryError> {
    let mut lines = [
        "id,olivine,plagioclase,r450,r470,r490.5",
        "A-1,0.5,0.5,0.1,0.2,0.3",
        "A-2,0.25,0.75,0.4,0.5,0.6",
    ];
    lines[line - 1] = text;
    SpectralLibrary::from_csv(lines.join("\n").as_bytes())
}

#[test]
fn a_library_is_read_whatever_wrote_it() {
    let plain = library(2, "A-1,0.5,0.5,0.1,0.2,0.3").unwrap();
    assert_eq!(plain.wavelengths_nm(), [450.0, 470.0, 490.5]);
    assert_eq!(plain.sample(1).fractions, [0.25, 0.75]);
    assert_eq!(plain.sample(1).dominant_mineral(), 1);
    assert_eq!(plain.sample(1).reflectance, [0.4, 0.5, 0.6]);
    let quoted = library(2, "\"A-1\" , 0.5,\"0.5\",1e-1,0.2,0.3\r\n\r").unwrap();
    assert_eq!(quoted, plain);
    let marked = library(1, "\u{feff}id,olivine,plagioclase,r450,r470,r490.5").unwrap();
    assert_eq!(marked, plain);
    assert_eq!(
        library(2, "\"a,\"\"b\",0.5,0.5,1,1,1")
            .unwrap()
            .sample(0)
            .id,
        "a,\"b"
    );
}

#[test]
fn the_sums_of_the_built_in_library_are_within_the_tolerance() {
    let library = SpectralLibrary::builtin();
    assert!(
        library
            .samples()
            .all(|sample| { (sample.fractions.iter().sum::<f64>() - 1.0).abs() < 1e-12 })
    );
    let most = |mineral| {
        library
            .samples()
            .filter(|sample| sample.dominant_mineral() == mineral)
            .count()
    };
    assert_eq!([most(0), most(1), most(2), most(3)], [41, 36, 26, 10]);
}

#[test]
fn each_fault_of_a_library_has_its_error() {
    let check = |line, text: &str, expected: &str| {
        let error = library(line, text).expect_err(text);
        assert_eq!(error.to_string(), expected);
        assert_eq!(error.line(), Some(line), "{error}");
    };
    check(
        2,
        "A-1,0.5,0.5,0.1,0.2",
        "line 2: 5 fields: expected 6, as the header has; \"r490.5\" is the first that is missing",
    );
    check(
        3,
        "A-2,0.5,0.5,1,1,1,1,1",
        "line 3: 8 fields: expected 6, as the header has",
    );
    check(
        1,
        "id,olivine,plagioclase,r470,r450,r490",
        "line 1, column \"r450\": 450 nm after 470 nm: expected ascending wavelengths, each once",
    );
    check(
        1,
        "id,olivine,plagioclase,r450,r450.0,r490",
        "line 1, column \"r450.0\": 450 nm after 450 nm: expected ascending wavelengths, each once",
    );
    check(
        1,
        "id,olivine,plagioclase,r0,r450,r490",
        "line 1, column \"r0\": expected a wavelength over 0 and up to 100000 nm",
    );
    check(
        1,
        "ID,olivine,plagioclase,r450,r470,r490",
        "line 1, column \"ID\": no such column: expected `id` as the first column; did you mean \"id\"?",
    );
    for (wrong, nearest) in [
        ("R470", "r470"),
        ("470", "r470"),
        ("r470nm", "r470"),
        ("quartz", "r470"),
    ] {
        check(
            1,
            &format!("id,olivine,plagioclase,r430,r450,{wrong}"),
            &format!(
                "line 1, column {wrong:?}: no such column: expected `id`, names of minerals, and then bands \
                 `rNNN`, NNN being nanometres; did you mean {nearest:?}?"
            ),
        );
    }
    check(
        1,
        "id,olivine,olivine,r450,r470,r490",
        "line 1, column \"olivine\": this column is given twice: expected each once",
    );
    check(
        1,
        "id,r450,r470,r490",
        "line 1: no mineral: expected `id`, at least one mineral, and then the bands",
    );
    check(
        1,
        "id,olivine,plagioclase,r450",
        "line 1: 1 bands: expected 2 to 4096 columns `rNNN`, NNN being nanometres",
    );
    for bad in ["nan", "inf", "-0.1", "1e400", "101", "0,1"] {
        assert!(
            library(2, &format!("A-1,0.5,0.5,{bad},0.2,0.3")).is_err(),
            "{bad}"
        );
    }
    for bad in ["nan", "-0.1", "1.1", ""] {
        check(
            2,
            &format!("A-1,{bad},0.5,0.1,0.2,0.3"),
            &format!("line 2, column \"olivine\": fraction {bad:?}: expected a number from 0 to 1"),
        );
    }
    check(
        2,
        "A-1,0.5,0.49,0.1,0.2,0.3",
        "line 2: the fractions sum to 0.99: expected 1 within 0.002",
    );
    check(
        2,
        ",0.5,0.5,0.1,0.2,0.3",
        "line 2, column \"id\": the sample has no id: expected a name",
    );
    check(
        3,
        "A-1,0.5,0.5,0.1,0.2,0.3",
        "line 3, column \"id\": the sample \"A-1\" is that of line 2, too: expected each id once",
    );
    check(
        2,
        "\"A-1,0.5,0.5,0.1,0.2,0.3",
        "line 2: a field in quotes must end with a quote before the next comma or the line's end",
    );
}

#[test]
fn what_is_no_library_is_an_error() {
    let read = SpectralLibrary::from_csv;
    assert_eq!(read(b"\n \n"), Err(LibraryError::NoHeader));
    assert_eq!(
        read(b"id,olivine,r450,r470\n\n"),
        Err(LibraryError::NoSample)
    );
    assert_eq!(
        read(b"id,olivine,r450,r470\na,1,\xff,1\n"),
        Err(LibraryError::NotText { line: 2 })
    );
    let large = vec![b' '; MAX_FILE_BYTES + 1];
    assert!(matches!(read(&large), Err(LibraryError::TooLarge { .. })));
    let minerals: Vec<String> = (0..65u8)
        .map(|i| format!("{}{}", char::from(b'a' + i / 26), char::from(b'a' + i % 26)))
        .collect();
    let wide = format!("id,{},r450,r470\n", minerals.join(","));
    let error = read(wide.as_bytes()).unwrap_err();
    assert!(error.to_string().contains("at most 64"), "{error}");
    let bands: Vec<String> = (1..=5000).map(|nm| format!("r{nm}")).collect();
    let long = format!("id,olivine,{}\n", bands.join(","));
    let error = read(long.as_bytes()).unwrap_err().to_string();
    assert_eq!(
        error,
        "line 1: 5000 bands: expected 2 to 4096 columns `rNNN`, NNN being nanometres"
    );
}

proptest! {
    /// Any rock reflects between nothing and all, and more dust brings it nearer to dust.
    #[test]
    fn reflectance_is_a_share(
        parts in prop::collection::vec(0.0..1.0f64, 5),
        grain_um in 5.0..5_000.0f64,
        dust in 0.0..=1.0f64,
    ) {
        prop_assume!(parts.iter().sum::<f64>() > 0.01);
        let sum: f64 = parts.iter().sum();
        let fractions: Vec<f64> = parts.iter().map(|part| part / sum).collect();
        let spectrum = mixed(&fractions, grain_um, dust);
        prop_assert!(spectrum.iter().all(|value| (0.0..=1.0).contains(value)), "{spectrum:?}");
        let model = SpectralModel::new(&wavelength_grid_nm());
        let bare = mixed(&fractions, grain_um, 0.0);
        for ((value, bare), dusty) in spectrum.iter().zip(&bare).zip(model.dust()) {
            let (low, high) = (bare.min(*dusty), bare.max(*dusty));
            prop_assert!((low - 1e-12..=high + 1e-12).contains(value));
        }
    }

    /// The order of lines is the order of samples, and values are those that were written.
    #[test]
    fn a_library_says_what_was_written(
        rows in prop::collection::vec((0.0..=1.0f64, prop::array::uniform3(0.0..=2.0f64)), 1..20),
    ) {
        let mut text = "id,olivine,plagioclase,r450,r470,r490\n".to_owned();
        for (i, (share, values)) in rows.iter().enumerate() {
            let [a, b, c] = values;
            text += &format!("s{i},{share},{},{a},{b},{c}\n", 1.0 - share);
        }
        let library = SpectralLibrary::from_csv(text.as_bytes()).unwrap();
        prop_assert_eq!(library.len(), rows.len());
        for (sample, (share, values)) in library.samples().zip(&rows) {
            prop_assert!((sample.fractions[0] - share).abs() < 1e-12);
            prop_assert_eq!(sample.reflectance, values);
        }
    }
}
