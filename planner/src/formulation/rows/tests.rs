//! Columns, and conversion of derivatives to columns.

use super::*;
use crate::formulation::System;
use crate::motion::{Ends, Motion};
use crate::problem::Weights;
use crate::test_robots::{self, random_unknowns};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Model};

fn problem(ends: Ends) -> Problem {
    let robot = &test_robots::all()[0];
    Problem::new(Model::new(robot), &test_robots::motion(robot, ends), Weights::default())
}

/// Returns the row that `write` makes for the window `at`, with its (column, derivative) pairs.
fn row(
    problem: &Problem,
    at: [usize; 3],
    write: impl FnOnce(&mut RowWriter),
) -> (Row, Vec<(usize, f64)>) {
    let columns = Columns::new(problem);
    let unknowns = random_unknowns(&problem.model, problem.frozen.len(), 1);
    let states = problem.states(&unknowns);
    let reuse = Rows::default();
    let mut out =
        RowWriter::new(problem, &columns, &unknowns, &states, None, Evaluation::All, reuse);
    out.enter(Family::Slip, at);
    out.set(2.0, Role::Equality);
    write(&mut out);
    out.row(6.0);
    // The previous row leaves nothing for the next row.
    out.row(0.0);
    let (rows, _) = out.finish();
    assert_eq!(rows.rows.len(), 2);
    assert!(rows.rows[1].entries.is_empty());
    assert_eq!(rows.values, [3.0, 0.0]); // 6 over the scale of 2
    let entries = rows.columns.iter().copied().zip(rows.derivatives.iter().copied()).collect();
    (rows.rows[0].clone(), entries)
}

#[test]
fn rows_with_a_known_pattern_are_those_without() {
    for (robot, ends) in test_robots::all()
        .iter()
        .flat_map(|robot| [Ends::Periodic, Ends::AtRest].map(|ends| (robot, ends)))
    {
        let problem =
            Problem::new(Model::new(robot), &test_robots::motion(robot, ends), Weights::default());
        let at = |seed| random_unknowns(&problem.model, problem.frozen.len(), seed);
        let system = System::new(&problem);
        let mut reused = system.rows(&at(1), Rows::default());
        for seed in [2, 3] {
            let expected = System::new(&problem).rows(&at(seed), Rows::default());
            reused = system.rows(&at(seed), reused);
            for rows in [&reused, &system.rows(&at(seed), Rows::default())] {
                assert_eq!((&rows.rows, &rows.values), (&expected.rows, &expected.values));
                assert_eq!((&rows.givens, &rows.columns), (&expected.givens, &expected.columns));
                for (found, expected) in rows.derivatives.iter().zip(&expected.derivatives) {
                    // Sums in another order differ by a few roundings of terms as large as those of a stiff row.
                    assert!((found - expected).abs() < 1e-12 * (1.0 + expected.abs()) * 1e3);
                }
            }
        }
    }
}

#[test]
fn values_and_derivatives_apart_are_those_together_for_rows_that_count() {
    for robot in test_robots::all() {
        let motion = test_robots::motion(&robot, Ends::Periodic);
        let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
        let system = System::new(&problem);
        let at = |seed| random_unknowns(&problem.model, problem.frozen.len(), seed);
        let mut apart = system.rows(&at(1), Rows::default());
        let (mut counting, mut others) = (0, 0);
        for seed in [2, 3] {
            let together = system.rows(&at(seed), Rows::default());
            // Some inequalities count only because of their multipliers.
            let shifts: Vec<f64> =
                (0..together.rows.len()).map(|k| if k % 7 == 0 { 0.5 } else { 0.0 }).collect();
            apart = system.values(&at(seed), apart);
            system.differentiate(&at(seed), &mut apart, &shifts);
            assert_eq!((&apart.rows, &apart.values), (&together.rows, &together.values));
            assert_eq!(apart.givens, together.givens);
            for ((row, value), &shift) in together.iter().zip(&shifts) {
                let counts = row.counts(value + shift);
                if counts {
                    let entries = row.entries.clone();
                    assert_eq!(apart.derivatives[entries.clone()], together.derivatives[entries]);
                }
                *(if counts { &mut counting } else { &mut others }) += 1;
            }
        }
        assert!(counting > 0 && others > 0, "{}: {counting} {others}", robot.name);
    }
}

#[test]
fn every_free_entry_has_one_column_and_takes_its_own_step() {
    let mut problem = problem(Ends::Periodic);
    problem.frozen[1][BASE_YAW] = true;
    problem.frozen[2].fill(true);
    let columns = Columns::new(&problem);
    let len = problem.layout.len;
    assert_eq!(columns.count, (problem.samples - 1) * len - 1 + 3);
    assert_eq!(columns.of_slot[1][BASE_YAW], None);
    let placement = columns.placement.expect("free when periodic");
    let mut seen: Vec<usize> =
        columns.of_slot.iter().flatten().flatten().copied().chain(placement).collect();
    seen.sort_unstable();
    assert!(seen.iter().copied().eq(0..columns.count));

    let before = random_unknowns(&problem.model, problem.samples, 1);
    let mut after = before.clone();
    let step: Vec<f64> = (0..columns.count).map(|column| (column + 1) as f64).collect();
    columns.add_step(&problem, &mut after, &step);
    for (slot, variables) in columns.of_slot.iter().enumerate() {
        for (variable, column) in variables.iter().enumerate() {
            let moved = column.map_or(0.0, |c| step[c] * problem.layout.scale[variable]);
            assert_eq!(after.slots[slot][variable], before.slots[slot][variable] + moved);
        }
    }
    let [x, y] = before.placement.offset_m;
    assert_eq!(after.placement.offset_m, [x + step[placement[0]], y + step[placement[1]]]);
    assert_eq!(after.placement.yaw_rad, before.placement.yaw_rad + step[placement[2]]);
}

#[test]
fn derivatives_are_scaled_added_up_and_kept_when_zero() {
    let problem = problem(Ends::AtRest);
    let columns = Columns::new(&problem);
    let force = problem.layout.end_effectors[0].force;
    let (row, entries) = row(&problem, [1, 2, 3], |out| {
        out.d(1, JOINTS, 3.0);
        out.d(1, JOINTS, 2.0);
        out.d(2, JOINTS, 0.0);
        out.d(1, force, 1.0);
    });
    assert_eq!(row.family, Family::Slip);
    let column = |slot: usize, variable: usize| columns.of_slot[slot][variable].expect("free");
    // Timeline sample 2 is slot 1.
    assert_eq!(
        entries,
        [
            (column(1, JOINTS), 2.5),
            (column(1, force), 0.5 * problem.force_scale_n()),
            (column(2, JOINTS), 0.0),
        ]
    );
}

#[test]
fn samples_of_one_slot_meet_in_one_column() {
    let problem = problem(Ends::AtRest);
    let columns = Columns::new(&problem);
    // At rest, the sample before the first is the first: −2q + q₋ + q₊ has two of three terms in one column.
    let (_, entries) = row(&problem, [0, 1, 2], |out| {
        out.d(0, JOINTS, 1.0);
        out.d(1, JOINTS, -2.0);
        out.d(2, JOINTS, 1.0);
    });
    let column = |slot: usize| columns.of_slot[slot][JOINTS].expect("free");
    assert_eq!(entries, [(column(0), -0.5), (column(1), 0.5)]);
}

#[test]
fn frozen_entries_leave_no_trace() {
    let mut problem = problem(Ends::AtRest);
    problem.frozen[1][JOINTS] = true;
    let columns = Columns::new(&problem);
    let (row, entries) = row(&problem, [1, 2, 3], |out| {
        out.d(1, JOINTS, 1.0);
        out.d(1, JOINTS + 1, 1.0);
    });
    assert_eq!(entries, [(columns.of_slot[1][JOINTS + 1].expect("free"), 0.5)]);
    assert_eq!(row.entries, 0..1);
}

#[test]
fn a_placed_sample_has_the_columns_of_its_slot_and_of_the_placement() {
    let problem = problem(Ends::Periodic);
    let columns = Columns::new(&problem);
    let last = problem.samples;
    let (_, entries) = row(&problem, [last - 1, last, last + 1], |out| {
        out.d(2, BASE_POSITION, 1.0);
    });
    let [dx, dy, turn] = columns.placement.expect("free when periodic");
    let column = |variable: usize| columns.of_slot[0][variable].expect("free");
    let names: Vec<usize> = entries.iter().map(|(column, _)| *column).collect();
    // x of the placed point depends on x and y of the stored one.
    assert_eq!(names, [dx, dy, turn, column(BASE_POSITION), column(BASE_POSITION + 1)]);
    assert_eq!((entries[0].1, entries[1].1), (0.5, 0.0));
}

/// Returns the robot with longer links between joints and larger wheels.
fn edited(robot: &Robot) -> Robot {
    let mut robot = robot.clone();
    for joint in &mut robot.joints {
        joint.parent_from_joint.translation.z *= 1.1;
    }
    robot.end_effectors.iter_mut().for_each(|ee| ee.radius_m *= 1.2);
    robot
}

/// Returns the rows of one problem with all derivatives, evaluated with the structure of another. `None` if the structures
/// differ.
fn again(before: &Problem, after: &Problem, shift: f64) -> Option<Rows> {
    let unknowns = random_unknowns(&after.model, after.frozen.len(), 4);
    let system = System::new(before);
    let rows = system.rows(&unknowns, Rows::default());
    let (system, mut rows) = System::again(after, &unknowns, system.into_structure(), rows)?;
    // With such shifts all inequalities count, or few.
    let shifts = vec![shift; rows.rows.len()];
    system.differentiate(&unknowns, &mut rows, &shifts);
    system.fits().then_some(rows)
}

#[test]
fn rows_of_an_edited_robot_come_from_the_structure_before_the_edit() {
    for (robot, ends) in test_robots::all()
        .iter()
        .flat_map(|robot| [Ends::Periodic, Ends::AtRest].map(|ends| (robot, ends)))
    {
        let problem = |robot: &Robot| {
            let motion = test_robots::motion(robot, ends);
            Problem::new(Model::new(robot), &motion, Weights::default())
        };
        let (before, after) = (problem(robot), problem(&edited(robot)));
        let rows = again(&before, &after, 1e9).expect("numbers alone differ");
        let unknowns = random_unknowns(&after.model, after.frozen.len(), 4);
        let expected = System::new(&after).rows(&unknowns, Rows::default());
        assert_eq!((&rows.rows, &rows.values), (&expected.rows, &expected.values));
        assert_eq!((&rows.givens, &rows.columns), (&expected.givens, &expected.columns));
        for (found, expected) in rows.derivatives.iter().zip(&expected.derivatives) {
            // As above.
            assert!((found - expected).abs() < 1e-12 * (1.0 + expected.abs()) * 1e3);
        }
    }
}

#[test]
fn another_structure_is_noticed() {
    let robot = &test_robots::all()[0];
    let motion = test_robots::motion(robot, Ends::Periodic);
    let problem = |robot: &Robot, motion: &Motion| {
        Problem::new(Model::new(robot), motion, Weights::default())
    };
    let before = problem(robot, &motion);
    assert!(again(&before, &before, 0.0).is_some());
    // Another end, another foot in the air, and one row less.
    let at_rest = test_robots::motion(robot, Ends::AtRest);
    assert!(again(&before, &problem(robot, &at_rest), 0.0).is_none());
    let mut steps = motion.clone();
    steps.stance[1][0] ^= true;
    assert!(again(&before, &problem(robot, &steps), 0.0).is_none());
    let mut anywhere = motion.clone();
    anywhere.goal.turn_rad = None;
    assert!(again(&before, &problem(robot, &anywhere), 0.0).is_none());
    // The same rows depend on other joints.
    let mut moved = robot.clone();
    moved.end_effectors[0].link = moved.joints[0].child;
    let moved = problem(&moved, &motion);
    let unknowns = random_unknowns(&moved.model, moved.frozen.len(), 4);
    let system = System::new(&before);
    let rows = system.rows(&unknowns, Rows::default());
    assert!(System::again(&moved, &unknowns, system.into_structure(), rows).is_some());
    assert!(again(&before, &moved, 0.0).is_none());
}
