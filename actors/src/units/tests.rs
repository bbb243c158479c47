//! Tests of how quantities are read and written.

use super::*;
use proptest::prelude::*;

#[test]
fn durations_are_exact() {
    let nanos = |text| parse_duration(text).map(SimDuration::as_nanos);
    assert_eq!(nanos("250ms"), Ok(250_000_000));
    assert_eq!(nanos("2.6s"), Ok(2_600_000_000));
    assert_eq!(nanos("5us"), Ok(5_000));
    assert_eq!(nanos("5 µs"), Ok(5_000));
    assert_eq!(nanos("3min"), Ok(180_000_000_000));
    assert_eq!(nanos("1h"), Ok(3_600_000_000_000));
    assert_eq!(nanos("0.0000000010s"), Ok(1));
    assert_eq!(nanos(".5s"), Ok(500_000_000));
    assert_eq!(nanos("0s"), Ok(0));
    assert_eq!(nanos("1sol"), Ok(88_775_244_000_000));
    assert_eq!(nanos("668.6sol"), Ok(59_355_128_138_400_000));
    assert_eq!(
        nanos("0.000000000025min"),
        Err(DURATION.out_of_range("0.000000000025min", NANOS))
    );
    assert_eq!(nanos("0.00000000005min"), Ok(3));
}

const NANOS: &str = "a whole number of nanoseconds";

#[test]
fn durations_may_have_several_units() {
    let nanos = |text| parse_duration(text).map(SimDuration::as_nanos);
    assert_eq!(nanos("3h8min"), Ok(11_280_000_000_000));
    assert_eq!(
        nanos(" 1sol 2d\t3h 4 min5s6ms7us8ns "),
        Ok(272_620_250_007_008)
    );
    assert_eq!(nanos("24h39min35.244s"), nanos("1sol"));
    assert_eq!(nanos("1h90min"), nanos("2.5h"));
    assert_eq!(nanos("0h0min"), Ok(0));
}

#[test]
fn each_mistake_is_called_by_its_name() {
    let says = |text: &str| parse_duration(text).unwrap_err().to_string();
    assert_eq!(
        says("5"),
        "5: expected a duration such as \"250ms\" or \"3h8min\"; a bare number has no unit"
    );
    assert!(says("40m").contains("\"m\" is none of its units ns, us"));
    assert_eq!(
        says("soon"),
        "\"soon\": expected a duration such as \"250ms\" or \"3h8min\""
    );
    assert!(says("0.5ns").contains("a whole number of nanoseconds"));
    assert!(says("99999999999999h").contains("smaller"));
    assert!(says("500000h500000h").contains("each once"));
    assert!(says("213503d24h").contains("smaller"));
    assert!(says("-5ms").contains("not negative"));
    for rubbish in [
        "", ".", "1.2.3s", "NaN", "1e3s", "\u{0}", "s", "3h-8min", "+5s",
    ] {
        assert!(parse_duration(rubbish).is_err(), "{rubbish}");
    }
    let fraction = parse_fraction("1.5").unwrap_err().to_string();
    assert!(fraction.contains("from 0 to 1"), "{fraction}");
    assert!(parse_data_size("1.5B").is_err());
}

#[test]
fn what_is_nearly_a_duration_is_told_what_is_wrong() {
    let says = |text: &str| parse_duration(text).unwrap_err().to_string();
    let expected = "expected a duration such as \"250ms\" or \"3h8min\"";
    let units = "is none of its units ns, us, µs, ms, s, min, h, d, sol";
    assert_eq!(
        says("1.5sols"),
        format!("\"1.5sols\": {expected}; \"sols\" {units}; did you mean \"sol\"?")
    );
    assert_eq!(
        says("8minh"),
        format!("\"8minh\": {expected}; \"minh\" {units}; did you mean \"min\"?")
    );
    let order = "its units must go from larger to smaller ones, each once, but";
    assert_eq!(
        says("3min8h"),
        format!("\"3min8h\": {expected}; {order} h comes after min")
    );
    assert_eq!(
        says("3h3h"),
        format!("\"3h3h\": {expected}; {order} h comes after h")
    );
    assert_eq!(
        says("1us1µs"),
        format!("\"1us1µs\": {expected}; {order} µs comes after us")
    );
    assert_eq!(
        says("1.5h30min"),
        format!("1.5h30min: {expected}; it must be in whole numbers but for the last one")
    );
    assert_eq!(
        says("3h8"),
        format!("3h8: {expected}; a bare number has no unit")
    );
}

#[test]
fn signs_and_zeros_are_where_they_belong() {
    assert_eq!(parse_signed_energy_j("-3Wh"), Ok(-10_800.0));
    assert!(parse_signed_energy_j("- 3Wh").is_err());
    assert_eq!(parse_temperature_k("-273.15degC"), Ok(0.0));
    assert_eq!(parse_temperature_k("20.1 °C"), Ok(293.25));
    assert_eq!(parse_temperature_k("0K"), Ok(0.0));
    assert!(parse_temperature_k("-1K").is_err());
    assert!(parse_temperature_k("-273.1500001degC").is_err());
    assert_eq!(parse_angle_rad("45deg"), Ok(std::f64::consts::FRAC_PI_4));
    let energy = parse_energy_j("5W").unwrap_err().to_string();
    assert!(
        energy.contains("\"W\" is none of its units uJ, mJ, J, kJ, MJ, Wh, kWh"),
        "{energy}"
    );
    assert!(energy.ends_with("did you mean \"Wh\"?"), "{energy}");
}

proptest! {
    #[test]
    fn what_is_printed_parses_back(whole: u64, positive in 0.0..1e9f64, any in -1e300..1e300f64) {
        let duration = SimDuration::from_nanos(whole);
        prop_assert_eq!(parse_duration(&print_duration(duration)), Ok(duration));
        prop_assert_eq!(parse_data_rate(&print_data_rate(whole)), Ok(whole));
        prop_assert_eq!(parse_data_size(&print_data_size(whole)), Ok(whole));
        prop_assert_eq!(parse_data_bits(&print_data_bits(whole)), Ok(whole));
        prop_assert_eq!(parse_rate(&print_rate(whole)), Ok(whole));
        prop_assert_eq!(parse_length_m(&print_length_m(positive)), Ok(positive));
        prop_assert_eq!(parse_speed_m_per_s(&print_speed_m_per_s(positive)), Ok(positive));
        prop_assert_eq!(parse_power_w(&print_power_w(positive)), Ok(positive));
        prop_assert_eq!(parse_energy_j(&print_energy_j(positive)), Ok(positive));
        prop_assert_eq!(parse_temperature_k(&print_temperature_k(positive)), Ok(positive));
        prop_assert_eq!(parse_signed_energy_j(&print_energy_j(any)), Ok(any));
        prop_assert_eq!(parse_angle_rad(&print_angle_rad(any)), Ok(any));
        let tiny = positive * 1e-300;
        prop_assert_eq!(parse_angle_rad(&print_angle_rad(-tiny)), Ok(-tiny));
    }

    /// A compound is the sum of its parts, each read alone.
    #[test]
    fn parts_add_up(sols in 0u64..100, days in 0u64..100, h in 0u64..99, min in 0u64..99, us: u16) {
        let text = format!("{sols}sol{days}d {h}h{min} min {us}us");
        let parts = [(sols, "sol"), (days, "d"), (h, "h"), (min, "min"), (u64::from(us), "us")];
        let nanos = parts.map(|(n, unit)| {
            let part = parse_duration(&format!("{n}{unit}"));
            part.unwrap().as_nanos()
        });
        let sum = SimDuration::from_nanos(nanos.iter().sum());
        prop_assert_eq!(parse_duration(&text), Ok(sum));
    }

    /// Energies in watt-hours are 3600 times the joules, rounded once: exact while they are whole.
    #[test]
    fn watt_hours_are_exact(tenths in 0u64..1 << 40) {
        let text = format!("{}.{}Wh", tenths / 10, tenths % 10);
        prop_assert_eq!(parse_energy_j(&text), Ok((tenths * 360) as f64));
    }

    #[test]
    fn no_text_panics(
        text in ".*",
        numbers in "-?([0-9]{0,60}\\.?[0-9]{0,60}(s|ns|h|sol|min|m|%|GiB|bit|degC|K|deg) ?){0,4}",
    ) {
        for text in [text, numbers] {
            let _ = parse_duration(&text);
            let _ = parse_length_m(&text);
            let _ = parse_speed_m_per_s(&text);
            let _ = parse_acceleration_m_per_s2(&text);
            let _ = parse_power_w(&text);
            let _ = parse_fraction(&text);
            let _ = parse_data_rate(&text);
            let _ = parse_data_size(&text);
            let _ = parse_data_bits(&text);
            let _ = parse_rate(&text);
            let _ = parse_energy_j(&text);
            let _ = parse_signed_energy_j(&text);
            let _ = parse_angle_rad(&text);
            let _ = parse_temperature_k(&text);
        }
    }
}
