//! Tests of a small fault campaign: every scenario with every loss, and reproducibility of runs.

mod planted;

use rollwalk_bench::campaign::scenario::Scenario;
use rollwalk_bench::campaign::{Case, Reaction, Subject, run};
use rollwalk_bus::candump;

/// Number of seeds of each scenario and loss.
const SEEDS: u64 = 4;

fn cases() -> impl Iterator<Item = Case> {
    Scenario::ALL.into_iter().flat_map(|scenario| {
        let with_loss = move |&loss_per_mille: &u16| {
            (0..SEEDS).map(move |seed| Case { scenario, loss_per_mille, seed })
        };
        scenario.losses().iter().flat_map(with_loss)
    })
}

#[test]
fn whatever_goes_wrong_the_rules_hold_and_there_is_a_way_back() {
    let subject = Subject::one_leg();
    for case in cases() {
        let (report, _) = run(&subject, case);
        assert!(report.is_clean(), "{report:#?}");
        if case.scenario == Scenario::EStop {
            assert_eq!(report.outcome, Reaction::Stopped, "{report:#?}");
        }
    }
}

/// Checks cases in which evidence is late.
///
/// In the first case the monitor judges before the STATUS that reports the stop. In the second the operator's DISARM arrives
/// before the actuator's timeout. In the third a bridge delays frames while the host is silent.
#[test]
fn a_run_is_judged_by_what_could_happen() {
    let subject = Subject::one_leg();
    for (scenario, loss_per_mille, seed) in
        [(Scenario::EStop, 30, 279), (Scenario::ActuatorDead, 300, 250), (Scenario::Chaos, 30, 853)]
    {
        let (report, _) = run(&subject, Case { scenario, loss_per_mille, seed });
        assert!(report.is_clean(), "{report:#?}");
    }
}

#[test]
fn a_run_is_the_same_every_time() {
    let subject = Subject::one_leg();
    for seed in 0..3 {
        let case = Case { scenario: Scenario::Chaos, loss_per_mille: 30, seed };
        let log = || {
            let mut text = Vec::new();
            candump::write(&run(&subject, case).1, &mut text).unwrap();
            text
        };
        assert!(log() == log(), "{case:?}");
    }
}
