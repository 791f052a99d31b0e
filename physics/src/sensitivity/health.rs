//! Usability of a rollout's derivatives.

use crate::event::ContactEvent;
use crate::sensitivity::Rollout;
use std::ops::Range;

/// Growth of a rollout's derivatives, and derivatives that are 0.
///
/// For robots that stand on their servos, derivatives with respect to the initial state do not grow, because disturbances
/// decay. They grow in throws, falls and tumbling. A gradient over many bounces hardly predicts finite changes.
#[derive(Clone, Debug, PartialEq)]
pub struct Health {
    /// Largest derivative of a body's position, m, or turn, rad, with respect to any parameter: initially and after each step.
    pub size: Vec<f64>,
    /// Contact events, each with its step.
    pub events: Vec<(usize, ContactEvent)>,
    /// Steps that were halved.
    pub halved: Vec<usize>,
    /// Parameters on which no position, turn or velocity depends, such as friction without slip, or gains of saturated motors.
    pub without_effect: Vec<usize>,
    /// Parameters whose derivatives become exactly 0, each with the step after which they do.
    pub vanishing: Vec<(usize, usize)>,
    /// True if all derivatives are finite.
    pub finite: bool,
}

impl Health {
    /// Evaluates the derivatives of given bodies with respect to all parameters, by the direct method.
    pub fn of(rollout: &Rollout, bodies: Range<usize>) -> Self {
        let parameters = rollout.parameters();
        let mut health = Self {
            size: Vec::with_capacity(rollout.steps() + 1),
            events: Vec::new(),
            halved: Vec::new(),
            without_effect: Vec::new(),
            vanishing: Vec::new(),
            finite: true,
        };
        let mut before = vec![false; parameters];
        let mut ever = vec![false; parameters];
        rollout.direct(|step, tangents| {
            let mut largest = 0.0_f64;
            for parameter in 0..parameters {
                let mut moves = false;
                for body in bodies.clone() {
                    let by = tangents.of(body, parameter);
                    let size = by.shift.norm().max(by.turn.norm());
                    let rate = by.velocity.norm().max(by.spin.norm());
                    health.finite &= (size + rate).is_finite();
                    largest = largest.max(size);
                    moves |= size.max(rate) != 0.0;
                }
                if before[parameter] && !moves {
                    health.vanishing.push((parameter, step));
                }
                before[parameter] = moves;
                ever[parameter] |= moves;
            }
            health.size.push(largest);
        });
        health.without_effect = (0..parameters).filter(|&parameter| !ever[parameter]).collect();
        for (step, report) in (1..).zip(rollout.reports()) {
            health.events.extend(report.events.iter().map(|event| (step, *event)));
            if report.subdivisions > 0 {
                health.halved.push(step);
            }
        }
        health
    }

    /// Ratio of the final to the initial size of the derivatives, for rollouts whose parameters are initial states.
    pub fn growth(&self) -> f64 {
        self.size[self.size.len() - 1] / self.size[0]
    }
}
