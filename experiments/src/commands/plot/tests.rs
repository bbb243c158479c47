//! Where topics end and fields begin.

use super::part;

#[test]
fn topics_end_at_the_last_dot_at_which_there_is_one() {
    let topics = ["/imu", "/state/rover_01/rover_state", "/odd.name"];
    let parted = |text: &str| part(text, &topics).map(|wanted| (wanted.glob, wanted.field));
    let both = |glob: &str, field: &str| (glob.to_owned(), field.to_owned());
    assert_eq!(
        parted("/imu.acceleration.x").unwrap(),
        both("/imu", "acceleration.x")
    );
    assert_eq!(parted("/odd.name.z").unwrap(), both("/odd.name", "z"));
    let glob = "/state/rover_*/rover_state";
    assert_eq!(parted(&format!("{glob}.e_j")).unwrap(), both(glob, "e_j"));
    let error = |text: &str| parted(text).unwrap_err().to_string();
    assert!(
        error("/imu").contains("the field is missing"),
        "{}",
        error("/imu")
    );
    assert!(
        error("/imo.z").contains("did you mean \"/imu\"?"),
        "{}",
        error("/imo.z")
    );
}
