//! Breaks every ban of the root `clippy.toml` once. `tests/house.rs` runs clippy on it and compares
//! what fires with the marks: a line that ends in `//~ PATH` must break the ban of PATH, any other
//! line none.

/// Iterates in an order that differs between runs.
#[rustfmt::skip]
pub fn hash_map(
    map: &std::collections::HashMap<u8, u8>, //~ std::collections::HashMap
) -> u8 {
    let mut last = 0;
    for key in map.keys() { //~ iter_over_hash_type
        last = *key;
    }
    last
}

/// As above.
pub fn hash_set(
    set: &std::collections::HashSet<u8>, //~ std::collections::HashSet
) -> usize {
    set.len()
}

/// Asks for the time of the machine.
pub fn clocks() {
    _ = std::time::Instant::now(); //~ std::time::Instant
    _ = std::time::SystemTime::now(); //~ std::time::SystemTime
}

/// Starts threads behind the executor's back.
pub fn threads() {
    std::thread::spawn(|| ()); //~ std::thread::spawn
    tokio::spawn(async {}); //~ tokio::spawn
}

/// Functions of `f64` whose last bits differ by platform.
pub fn floats_64(x: f64) {
    _ = x.sin(); //~ f64::sin
    _ = x.cos(); //~ f64::cos
    _ = x.tan(); //~ f64::tan
    _ = x.sin_cos(); //~ f64::sin_cos
    _ = x.asin(); //~ f64::asin
    _ = x.acos(); //~ f64::acos
    _ = x.atan(); //~ f64::atan
    _ = x.atan2(x); //~ f64::atan2
    _ = x.sinh(); //~ f64::sinh
    _ = x.cosh(); //~ f64::cosh
    _ = x.tanh(); //~ f64::tanh
    _ = x.asinh(); //~ f64::asinh
    _ = x.acosh(); //~ f64::acosh
    _ = x.atanh(); //~ f64::atanh
    _ = x.exp(); //~ f64::exp
    _ = x.exp2(); //~ f64::exp2
    _ = x.exp_m1(); //~ f64::exp_m1
    _ = x.ln(); //~ f64::ln
    _ = x.ln_1p(); //~ f64::ln_1p
    _ = x.log(x); //~ f64::log
    _ = x.log2(); //~ f64::log2
    _ = x.log10(); //~ f64::log10
    _ = x.powf(x); //~ f64::powf
    _ = x.powi(2); //~ f64::powi
    _ = x.hypot(x); //~ f64::hypot
    _ = x.cbrt(); //~ f64::cbrt
    _ = x.mul_add(x, x); //~ f64::mul_add
}

/// Functions of `f32` whose last bits differ by platform.
pub fn floats_32(x: f32) {
    _ = x.sin(); //~ f32::sin
    _ = x.cos(); //~ f32::cos
    _ = x.tan(); //~ f32::tan
    _ = x.sin_cos(); //~ f32::sin_cos
    _ = x.asin(); //~ f32::asin
    _ = x.acos(); //~ f32::acos
    _ = x.atan(); //~ f32::atan
    _ = x.atan2(x); //~ f32::atan2
    _ = x.sinh(); //~ f32::sinh
    _ = x.cosh(); //~ f32::cosh
    _ = x.tanh(); //~ f32::tanh
    _ = x.asinh(); //~ f32::asinh
    _ = x.acosh(); //~ f32::acosh
    _ = x.atanh(); //~ f32::atanh
    _ = x.exp(); //~ f32::exp
    _ = x.exp2(); //~ f32::exp2
    _ = x.exp_m1(); //~ f32::exp_m1
    _ = x.ln(); //~ f32::ln
    _ = x.ln_1p(); //~ f32::ln_1p
    _ = x.log(x); //~ f32::log
    _ = x.log2(); //~ f32::log2
    _ = x.log10(); //~ f32::log10
    _ = x.powf(x); //~ f32::powf
    _ = x.powi(2); //~ f32::powi
    _ = x.hypot(x); //~ f32::hypot
    _ = x.cbrt(); //~ f32::cbrt
    _ = x.mul_add(x, x); //~ f32::mul_add
}
