//! End of a controller's program: drives without a watchdog must not keep their last set-points.

use crate::{S, connect, robot};
use rollwalk_bus::link::LinkError;
use rollwalk_bus::port::{Event, Inlet, LiveLink, Outlet, Port};
use rollwalk_firmware::Settings;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::State;
use rollwalk_sim_host::body::Body;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::LocalController;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::live::{Reopen, controller, motors};
use rollwalk_sim_host::rig::Observer;
use rollwalk_sim_host::servo::Servo;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

struct TestOutlet(Sender<Frame>);

impl Outlet for TestOutlet {
    fn is_free(&self) -> bool {
        true
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.0.send(*frame).map_err(|_| LinkError::Down("closed".into()))
    }
}

struct TestInlet(Receiver<Frame>);

impl Inlet for TestInlet {
    fn next_event(&mut self) -> Result<Option<Event>, LinkError> {
        match self.0.recv_timeout(Duration::from_millis(10)) {
            Ok(frame) => Ok(Some(Event::Frame(frame))),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(LinkError::Down("closed".into())),
        }
    }
}

/// Returns both ends of a bus.
fn bus() -> [Port; 2] {
    let ((to_far, far), (to_near, near)) = (channel(), channel());
    [(to_far, near), (to_near, far)].map(|(to, from)| Port {
        outlet: Box::new(TestOutlet(to)),
        inlet: Box::new(TestInlet(from)),
    })
}

/// Reopens no bus.
struct NoReopening;

impl Reopen for NoReopening {
    fn lost(&mut self, _bus: Interface, _why: &LinkError) {}

    fn reopen(&mut self, _bus: Interface) -> Option<Port> {
        None
    }
}

/// Time of the latest step of the motors, µs.
struct MotorTime(Arc<AtomicU64>);

impl Observer for MotorTime {
    fn on_motor_step(&mut self, at: SimTime, _body: &Body) {
        self.0.store(at.as_us(), Ordering::SeqCst);
    }
}

#[test]
fn in_real_time_a_controller_that_ends_switches_torque_off() {
    let ([link, host], [hip, hip_motors], [knee, knee_motors]) = (bus(), bus(), bus());
    let (leaves, ends, driving) =
        (AtomicBool::new(false), AtomicBool::new(false), AtomicUsize::new(0));
    // The motors' time is not that of a busy computer.
    let mut clock = MotorTime(Arc::default());
    let motor_us = Arc::clone(&clock.0);
    thread::scope(|scope| {
        scope.spawn(|| {
            let mut body = Body::new(&robot::robot());
            motors::run(
                &mut body,
                vec![hip_motors, knee_motors],
                &mut NoReopening,
                &mut clock,
                |body| {
                    let count =
                        body.servos().iter().filter(|servo| Servo::is_driving(servo)).count();
                    driving.store(count, Ordering::SeqCst);
                    !ends.load(Ordering::SeqCst)
                },
            )
            .unwrap();
        });
        let controller = scope.spawn(|| {
            let buses = robot::robot().controller_buses();
            let (settings, library) = (Settings::default(), robot::library());
            let period = Duration::from_secs(1) / u32::from(settings.control_hz);
            let mut core =
                LocalController::with_library(robot::config(), buses, settings, &library);
            let goes_on = |_: &mut LocalController| !leaves.load(Ordering::SeqCst);
            controller::run(&mut core, period, link, &mut NoReopening, vec![hip, knee], goes_on)
                .unwrap();
        });
        let mut session = connect(LiveLink::new(host));
        // On a busy computer the self test takes longer than the connection.
        session.wait_for_state(State::Disarmed, 10 * S).unwrap();
        session.arm().unwrap();
        let armed = driving.load(Ordering::SeqCst);
        leaves.store(true, Ordering::SeqCst);
        controller.join().unwrap();
        let until_us = motor_us.load(Ordering::SeqCst) + 50_000;
        let start = Instant::now();
        while motor_us.load(Ordering::SeqCst) < until_us {
            assert!(start.elapsed() < Duration::from_secs(60), "the motors make no step");
            thread::sleep(Duration::from_millis(1));
        }
        ends.store(true, Ordering::SeqCst);
        assert_eq!((armed, driving.load(Ordering::SeqCst)), (3, 0), "driving before and after");
    });
}
