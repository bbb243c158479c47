//! Tables with mistakes in them, and rovers that do not fit.

use farside_actors::rover::RoverConfig;

use super::*;

fn refused(text: &str) -> String {
    let error = RelayTable::new(text, system().model.clone(), &[]).unwrap_err();
    error.to_string()
}

#[test]
fn mistakes_in_tables_are_named() {
    for (text, error) in [
        (
            "[procedure.DriveTwo]\nidle = true",
            "line 1: procedure.DriveTwo: \"DriveTwo\" is no procedure of the model; did you mean \
             \"DriveTo\"?",
        ),
        (
            "\n[procedure.BackUp]\ncommand = 'backup'",
            "line 2: procedure.BackUp.command: \"backup\" is no command; did you mean \"back-up\"?",
        ),
        (
            "[procedure.BackUp]\ncommand = 'back-up'\nwith = { distance = { input = 'distanse', \
             unit = 'dm' } }",
            "line 1: procedure.BackUp.with.distance: \"distanse\" is no input of the procedure; did \
             you mean \"distance\"?",
        ),
        (
            "[procedure.BackUp]\ncommand = 'back-up'\nwith = { distnce = 3 }",
            "line 1: procedure.BackUp.with.distnce: \"distnce\" is no argument of the command; did \
             you mean \"distance\"?",
        ),
        (
            "[procedure.BackUp]\ncommand = 'back-up'\nwith = { distance = { input = 'distance', \
             unit = 'deg' } }",
            "line 1: procedure.BackUp.with.distance: expected one of the units m, dm, cm, mm, found \
             deg",
        ),
        (
            "[procedure.BackUp]\ncommand = 'back-up'\nwith = { distance = { value = 1, unit = 'm' } \
             }",
            "line 1: procedure.BackUp.with: expected 1 inputs, as the model has, found 0",
        ),
        (
            "[procedure.BackUp]\ncommand = 'back-up'",
            "line 1: procedure.BackUp.with.distance: expected a value, found none",
        ),
        (
            "[procedure.DriveTo]\ncommand = 'back-up'\nwith = { distance = { input = 'x', \
             unit = 'dm' } }",
            "line 1: procedure.DriveTo.with: expected 2 inputs, as the model has, found 1",
        ),
        (
            "[procedure.TakeImage]\ncommand = 'back-up'\nwith = { distance = { input = 'camera', \
             unit = 'dm' } }",
            "line 1: procedure.TakeImage.with.distance: expected a value of the type Camera, which \
             ?camera has, found a number",
        ),
        (
            "[procedure.PitchMeasure]\ncommand = 'stop'",
            "line 1: procedure.PitchMeasure.with: expected 1 inputs, as the model has, found 0",
        ),
        (
            "[procedure.TempReadCompare]\ncommand = 'stop'",
            "line 1: procedure.TempReadCompare.status: expected 3 outputs, as the model has, found \
             1",
        ),
        (
            "[ends]\ndone = 'okay'\n[procedure.Stop]\ncommand = 'stop'",
            "line 3: procedure.Stop.status: \"okay\" is no symbol of its type; did you mean \"ok\"?",
        ),
        (
            "[procedure.PitchMeasure]\noutputs = { pitch = { reading = 'pich', unit = 'deg' } }",
            "line 1: procedure.PitchMeasure.outputs.pitch: \"pich\" is no reading; did you mean \
             \"pitch\"?",
        ),
        (
            "[procedure.PitchMeasure]\noutputs = { pitch = { reading = 'pitch' } }",
            "line 1: procedure.PitchMeasure.outputs.pitch: expected one of the units rad, mrad, deg, \
             ddeg, found none",
        ),
        (
            "[procedure.PitchMeasure]\noutputs = { ptch = { reading = 'pitch', unit = 'deg' } }",
            "line 1: procedure.PitchMeasure.outputs.ptch: \"ptch\" is no output of the procedure; did \
             you mean \"pitch\"?",
        ),
        (
            "[procedure.PitchMeasure]\noutputs = { pitch_rcvd = { reading = 'pitch', unit = 'deg' } \
             }",
            "line 1: procedure.PitchMeasure.outputs.pitch_rcvd: expected a value of the type \
             Boolean, which ?pitch_rcvd has, found the reading pitch",
        ),
        (
            "[procedure.PitchMeasure]\noutputs = { pitch = 200 }",
            "line 1: procedure.PitchMeasure.outputs.pitch: expected a value of the type Degrees, \
             which ?pitch has, found 200",
        ),
        (
            "[procedure.Still]",
            "line 1: procedure.Still: expected one of idle, command and outputs, found none",
        ),
        (
            "[procedure.Stop]\nidle = true\ncommand = 'stop'",
            "line 1: procedure.Stop.idle: expected one of idle, command and outputs, found more of \
             them",
        ),
    ] {
        assert_eq!(refused(text), error);
    }
    assert!(refused("[procedure.Still]\nidel = true").contains("line 2"));
    assert!(refused("[procedure.Still").contains("line 1"));
}

#[test]
fn a_table_covers_its_registers_and_a_rover_has_what_it_names() {
    let error =
        RelayTable::new("procedure = {}", system().model.clone(), &["Fans_SV"]).unwrap_err();
    let expected = "Fans_SV can say FansUnchanged, and no entry of the relay's table does";
    assert_eq!(error.to_string(), expected);
    let error = RelayTable::new(RELAY_TEXT, system().model.clone(), &["Fan_SV"]).unwrap_err();
    let expected = "\"Fan_SV\" is no timeline of the model; did you mean \"Fans_SV\"?";
    assert_eq!(error.to_string(), expected);
    let k9 = RoverConfig::named("k9").unwrap();
    table().check_rover(&k9).unwrap();
    let fido = RoverConfig::named("fido").unwrap();
    let error = table().check_rover(&fido).unwrap_err().to_string();
    assert!(
        error.starts_with("procedure.TakeImage: \"wide_eye\" is no instrument of the rover"),
        "{error}"
    );
    let text = "[procedure.Stop]\ncommand = 'stop'\nwith = { part = 'wide_eyes' }";
    let table = RelayTable::new(text, system().model.clone(), &[]).unwrap();
    let error = table.check_rover(&k9).unwrap_err().to_string();
    assert!(error.ends_with("did you mean \"wide_eye\"?"), "{error}");
}
