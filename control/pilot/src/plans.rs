//! Planner of a steered robot, in its own thread: receives requests, and returns the part of each horizon that is played
//! ([`Stretch`]).

use crate::pilot::{Request, SteeringRequest};
use rollwalk_planner::receding::{
    Course, CourseError, Gait, HorizonError, HorizonOptions, Stretch,
};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::{Duration, Instant};

/// Minimum duration of a horizon, s, in which a robot on wheels can stop. A horizon lasts at least a period of the gait.
const LEAST_HORIZON_S: f64 = 1.0;
/// Duration of the played part of a horizon, s: several frames of the gait, but short compared with the operator's reaction.
const STRETCH_S: f64 = 0.15;

/// Robot and gait of a course.
#[derive(Clone, Debug)]
pub struct Route {
    pub robot: Robot,
    /// Joint angles in SAFE, rad.
    pub safe_rad: Vec<f64>,
    /// Gait for walking; `None` if the robot only drives.
    pub gait: Option<Gait>,
}

/// Sample spacing of a robot that only drives, s.
const DRIVE_INTERVAL_S: f64 = 0.1;

impl Route {
    /// Sample spacing of horizons, s.
    pub fn interval_s(&self) -> f64 {
        self.gait.as_ref().map_or(DRIVE_INTERVAL_S, Gait::interval_s)
    }

    /// Duration of a horizon, s.
    pub fn horizon_s(&self) -> f64 {
        let period_s = |gait: &Gait| gait.samples() as f64 * gait.interval_s();
        self.gait.as_ref().map_or(0.0, period_s).max(LEAST_HORIZON_S)
    }

    /// Creates a course that begins at rest in SAFE.
    ///
    /// # Errors
    /// Returns an error if the gait is for another robot.
    pub fn course(&self) -> Result<Course, HorizonError> {
        let options = HorizonOptions { duration_s: self.horizon_s(), ..HorizonOptions::default() };
        Course::new(&self.robot, &self.safe_rad, self.interval_s(), STRETCH_S, options)
    }
}

/// Planner of the current course. A request with a new course number starts a new course.
#[derive(Debug)]
pub struct Courses {
    route: Route,
    course: Option<(u32, Course)>,
    walks: bool,
}

impl Courses {
    /// Creates a planner for a route.
    pub fn new(route: Route) -> Self {
        Self { route, course: None, walks: false }
    }

    /// Plans the next horizon of a request. When `is_over` returns true, the solver stops and returns its best samples.
    ///
    /// # Errors
    /// Returns an error if no plan continues the course.
    pub fn plan(
        &mut self,
        request: Request,
        mut is_over: impl FnMut() -> bool,
    ) -> Result<Stretch, CourseError> {
        let Request { course: number, wanted: SteeringRequest { steering, walks } } = request;
        let known = self.course.take().filter(|(known, _)| *known == number);
        let mut course = match known {
            Some((_, course)) => course,
            None => {
                self.walks = false;
                self.route.course()?
            }
        };
        if let Some(gait) = self.route.gait.as_ref().filter(|_| walks != self.walks) {
            let stand =
                Gait::standing_in(&self.route.robot, gait.interval_s(), &self.route.safe_rad);
            let gait = if walks { Ok(gait.clone()) } else { stand };
            course.change_gait(gait.expect("a gait has a spacing"))?;
            self.walks = walks;
        }
        let mut go_on = |_: &_| {
            if is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let stretch = course.go_on(steering, &mut go_on);
        self.course = Some((number, course));
        stretch
    }
}

/// Planned part of a horizon, and the planning time.
#[derive(Debug)]
pub struct PlannedStretch {
    /// Request that it answers.
    pub request: Request,
    pub stretch: Result<Stretch, CourseError>,
    /// Planning time.
    pub took: Duration,
}

#[derive(Debug)]
pub struct Planner {
    pub requests: Sender<Request>,
    /// Receiver of planned parts of horizons.
    pub planned: Receiver<PlannedStretch>,
}

impl Planner {
    /// Starts the planner thread. A plan takes at most `budget`, rounded up to a whole iteration.
    pub fn start(route: Route, budget: Duration) -> Self {
        let (requests, asked) = mpsc::channel::<Request>();
        let (answers, planned) = mpsc::channel();
        thread::spawn(move || {
            let mut courses = Courses::new(route);
            for request in asked {
                let begun = Instant::now();
                let stretch = courses.plan(request, || begun.elapsed() >= budget);
                if answers.send(PlannedStretch { request, stretch, took: begun.elapsed() }).is_err()
                {
                    return;
                }
            }
        });
        Self { requests, planned }
    }
}
