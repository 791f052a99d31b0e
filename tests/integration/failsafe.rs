//! The safety state machine on the command line: a walk by script, by arguments, and what it is shown as.

use crate::desk;
use rollwalk_tests::{Outcome, checkout};
use std::fs;
use std::io::Write;
use std::process::Stdio;

/// Runs a session with `script` on standard input.
fn session(args: &[&str], script: &str) -> Outcome {
    let desk = desk();
    let mut command = desk.command(&[&["failsafe"], args].concat());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(script.as_bytes()).unwrap();
    child.wait_with_output().unwrap().into()
}

#[test]
fn a_walk_by_script() {
    let script = "\
# the host goes away while a motion plays, and then an actuator too
armc
ALIGNED
MotionStarted
HostLost
FeedbackLost Disarm HostLost
FaultFree
why
DampingElapsed
clear
ArmConfirmed
ClearConfirmed
status";
    let expected = "\
Disarmed --ArmConfirmed--> Aligning: AlignFromMeasured
Aligning: torque driven, severity none, faults none
Aligning --Aligned--> Ready: HoldSafe
Ready: torque driven, severity none, faults none
Ready --MotionStarted--> Playing
Playing: torque driven, severity none, faults none
Playing --HostLost--> Returning: RouteToSafe; fault 2 host lost latched
Returning: torque driven, severity return, faults 2 host lost
together; the most severe comes first:
Returning --FeedbackLost--> Damped: Damp; fault 3 actuator silent latched
Damped --HostLost--> Damped: nothing to do
Damped --Disarm--> Damped: nothing to do
Damped: torque damped, severity damp, faults 2 host lost, 3 actuator silent
FaultFree cannot arise here: it does in TorqueOff
Damped: torque damped, severity damp, faults 2 host lost, 3 actuator silent
Returning --FeedbackLost--> Damped: Damp; fault 3 actuator silent latched
FeedbackLost is of severity damp.
Fault 2 host lost is latched: HostLost in Playing.
Fault 3 actuator silent is latched: FeedbackLost in Returning.
Cleared by: DampingElapsed, ClearConfirmed.
Damped --DampingElapsed--> TorqueOff: CutTorque
TorqueOff: torque off, severity torque off, faults 2 host lost, 3 actuator silent
CLEAR is accepted in TorqueOff; ClearConfirmed forgets: 2 host lost, 3 actuator silent.
TorqueOff --ArmConfirmed--> TorqueOff: nothing to do
TorqueOff: torque off, severity torque off, faults 2 host lost, 3 actuator silent
TorqueOff --ClearConfirmed--> SelfTest: RunSelfTest; fault 2 host lost forgotten; fault 3 actuator silent forgotten
SelfTest: torque off, severity none, faults none
SelfTest: torque off, severity none, faults none
";
    assert_eq!(session(&[], script).succeeds(), expected);
}

#[test]
fn a_line_can_be_taken_back_and_the_beginning_returned_to() {
    let script = "Leaning Tipped\nback\nfrom EStopped\npath Ready\npath Boot\nreset\nquit\nEStop";
    let expected = "\
together; the most severe comes first:
Playing --Tipped--> Damped: Damp; fault 7 tilt latched
Damped --Leaning--> Damped: nothing to do
Damped: torque damped, severity damp, faults 7 tilt
Playing: torque driven, severity none, faults none
EStopped: torque off, severity emergency stop, faults none
EStopped --ClearConfirmed--> SelfTest: RunSelfTest
SelfTest --SelfTestPassed--> Disarmed
Disarmed --ArmConfirmed--> Aligning: AlignFromMeasured
Aligning --Aligned--> Ready: HoldSafe
No event leads to Boot, only switching the power on does.
Playing: torque driven, severity none, faults none
";
    assert_eq!(session(&["--from", "playing"], script).succeeds(), expected);
}

#[test]
fn wrong_lines_are_told_and_end_nothing() {
    let script = "coffee\nhsotlost\npath\nfrom nowhere\nback\nevents now\nEStop coffee\nstatus";
    let outcome = session(&[], script);
    for words in [
        "there is no event or command `coffee`",
        "`hsotlost`; did you mean `HostLost`?",
        "`path` needs one state after it; for example `path Ready`",
        "there is no state `nowhere`; known are: `Boot`, `SelfTest`",
        "there is nothing to take back",
        "`events` takes no `now`",
        "there is no event `coffee`",
    ] {
        assert!(outcome.stderr.contains(words), "{words} in\n{}", outcome.stderr);
    }
    // Of the line with an event that there is not, nothing has happened.
    assert_eq!(outcome.succeeds(), "Disarmed: torque off, severity none, faults none\n");
}

#[test]
fn arguments_are_lines() {
    let desk = desk();
    let said = desk.run(&["failsafe", "ArmConfirmed", "HostLost"]).succeeds();
    let expected = "\
Disarmed --ArmConfirmed--> Aligning: AlignFromMeasured
Aligning: torque driven, severity none, faults none
Aligning --HostLost--> Damped: Damp; fault 2 host lost latched
Damped: torque damped, severity damp, faults 2 host lost
";
    assert_eq!(said, expected);
    desk.run(&["failsafe", "ArmConfirmed", "HostLots"])
        .fails(1, &["there is no event or command `HostLots`", "did you mean `HostLost`?"]);
    let outcome = desk.run(&["failsafe", "--from", "Redy", "status"]);
    assert_eq!(outcome.code, 2, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("did you mean `Ready`?"), "{}", outcome.stderr);
}

#[test]
fn without_torque_a_silent_host_is_no_fault() {
    let said = desk().run(&["failsafe", "HostLost", "--from", "Disarmed"]).succeeds();
    let expected = "\
HostLost cannot arise here: without torque it is no fault, but arming is refused
Disarmed: torque off, severity none, faults none
";
    assert_eq!(said, expected);
    // SAFE has to be reached before it has been held.
    let said = desk().run(&["failsafe", "HoldElapsed", "--from", "Returning"]).succeeds();
    assert!(said.starts_with("HoldElapsed cannot arise here: SAFE is not held"), "{said}");
}

#[test]
fn the_table_is_that_of_the_documentation() {
    let page = fs::read_to_string(checkout().join("docs/playback-and-safety.md")).unwrap();
    let (_, after) = page.split_once("<!-- transitions -->\n").expect("the table");
    let (table, _) = after.split_once("<!-- end -->").expect("an end mark");
    assert_eq!(desk().run(&["failsafe", "table"]).succeeds(), table);
}

#[test]
fn the_graph_has_every_transition() {
    let desk = desk();
    let dot = desk.run(&["failsafe", "dot"]).succeeds();
    assert!(dot.starts_with("digraph") && dot.trim_end().ends_with('}'), "{dot}");
    let table = desk.run(&["failsafe", "table"]).succeeds();
    for row in table.lines().skip(2) {
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        let [_, from, event, next, ..] = cells[..] else { panic!("{row}") };
        let arrow = format!("  {from} -> {next} [");
        let drawn = dot.lines().any(|line| {
            let label = line.strip_prefix(&arrow).and_then(|rest| rest.split('"').nth(1));
            label.is_some_and(|label| label.split("\\n").any(|name| name == event))
        });
        assert!(drawn, "{row} in\n{dot}");
    }
}

#[test]
fn lists_of_events_and_states_say_where_it_stands() {
    let said = desk().run(&["failsafe", "--from", "TorqueOff", "events", "states", "help"]);
    let said = said.succeeds();
    let row = |name: &str| {
        let line = said.lines().find(|line| line.starts_with(name));
        line.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    assert_eq!(row("FaultFree").unwrap(), "FaultFree none Disarmed None");
    assert_eq!(row("EStop ").unwrap(), "EStop emergency stop EStopped CutTorque 12 emergency stop");
    assert_eq!(row("HostLost"), None);
    assert_eq!(row("TorqueOff").unwrap(), "TorqueOff off refused here");
    assert!(said.contains("the fewest events that lead to a state"), "{said}");
}
