//! Reads any text as each quantity. Whatever the text, there is an error to print, or a quantity
//! that reads back from how it is printed.
#![no_main]

use farside_actors::units::*;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    macro_rules! check {
        ($($parse:ident $print:ident),*) => { $(
            match $parse(text) {
                Ok(value) => assert_eq!($parse(&$print(value)), Ok(value), "{text:?}"),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        )* };
    }
    check!(
        parse_duration print_duration,
        parse_length_m print_length_m,
        parse_speed_m_per_s print_speed_m_per_s,
        parse_acceleration_m_per_s2 print_acceleration_m_per_s2,
        parse_angle_rad print_angle_rad,
        parse_energy_j print_energy_j,
        parse_signed_energy_j print_energy_j,
        parse_power_w print_power_w,
        parse_temperature_k print_temperature_k,
        parse_data_rate print_data_rate,
        parse_data_size print_data_size,
        parse_data_bits print_data_bits,
        parse_rate print_rate
    );
});
