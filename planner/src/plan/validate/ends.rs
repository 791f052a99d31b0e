//! States one interval outside a motion: copies of its samples, or states of the motions that it joins.

use super::Field;
use crate::families::AGREEMENT;
use crate::motion::Ends;
use crate::plan::{EndEffectorSample, Placement, Plan, PlanError, Sample};
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Model};
use rollwalk_multibody::rotation::yaw_rotation;

impl Plan {
    /// Checks that the states outside the motion agree with its kind of ends.
    pub(super) fn validate_ends(&self, at: &Field) -> Result<(), PlanError> {
        at.of("end_placement.offset_m").finite(&self.end_placement.offset_m)?;
        at.of("end_placement.yaw_rad").finite(&[self.end_placement.yaw_rad])?;
        let (Some(first), Some(last)) = (self.samples.first(), self.samples.last()) else {
            return Ok(());
        };
        let before = EndState { plan: self, state: &self.before, at: at.of("before") };
        let after = EndState { plan: self, state: &self.after, at: at.of("after") };
        let before_s = -self.sample_interval_s;
        let after_s = self.samples.len() as f64 * self.sample_interval_s;
        before.at.of("time_s").near(self.before.time_s, before_s, "one interval earlier")?;
        after.at.of("time_s").near(self.after.time_s, after_s, "one interval later")?;
        match self.motion.ends {
            Ends::Periodic => {
                let (on, back) = (self.end_placement, self.end_placement.inverse());
                before.repeats(last, back, "as in the last sample, moved back by end_placement")?;
                after.repeats(first, on, "as in the first sample, moved by end_placement")
            }
            Ends::AtRest => {
                let still = Placement::default();
                before.copies(first, still, "as in the first sample: at rest")?;
                after.copies(last, still, "as in the last sample: at rest")
            }
            Ends::Prescribed => {
                for (end, sample, meaning) in [
                    (&before, first, "as in the first sample"),
                    (&after, last, "as in the last sample"),
                ] {
                    end.has_contacts_of(sample, meaning)?;
                    end.has_torques_of(sample, meaning)?;
                }
                let model = self.motion.model(&self.robot);
                before.is_pose_of(&model)?;
                after.is_pose_of(&model)?;
                self.validate_end_placement(first, last, at)
            }
        }
    }

    /// Checks that the base of the final sample is that of the first sample, moved by `end_placement`.
    fn validate_end_placement(
        &self,
        first: &Sample,
        last: &Sample,
        at: &Field,
    ) -> Result<(), PlanError> {
        let meaning = "as in the first sample, moved by end_placement";
        let at = at.item("samples", self.samples.len() - 1);
        let [x, y, _] = self.end_placement.point(first.base_position_m);
        let [yaw, ..] = last.base_yaw_pitch_roll_rad;
        let moved = first.base_yaw_pitch_roll_rad[0] + self.end_placement.yaw_rad;
        at.of("base_position_m").all_near(&last.base_position_m[..2], &[x, y], meaning)?;
        at.of("base_yaw_pitch_roll_rad[0]").near(yaw, moved, meaning)
    }
}

/// State outside the motion.
struct EndState<'a> {
    plan: &'a Plan,
    state: &'a Sample,
    at: Field<'a>,
}

impl EndState<'_> {
    /// Iterates over end effectors: path, state here, and state in a sample.
    fn feet<'b>(
        &'b self,
        sample: &'b Sample,
    ) -> impl Iterator<Item = (Field<'b>, &'b EndEffectorSample, &'b EndEffectorSample)> {
        let both = self.state.end_effectors.iter().zip(&sample.end_effectors).enumerate();
        both.map(|(j, (here, there))| (self.at.item("end_effectors", j), here, there))
    }

    fn has_contacts_of(&self, sample: &Sample, meaning: &str) -> Result<(), PlanError> {
        for (at, here, there) in self.feet(sample) {
            let expected = format!("{}, {meaning}", there.contact);
            at.of("contact").holds(here.contact == there.contact, here.contact, expected)?;
        }
        Ok(())
    }

    fn has_torques_of(&self, sample: &Sample, meaning: &str) -> Result<(), PlanError> {
        let at = self.at.of("joint_torque_nm");
        at.all_near(&self.state.joint_torque_nm, &sample.joint_torque_nm, meaning)?;
        for (at, here, there) in self.feet(sample) {
            let [here, there] = [&here.motor_torque_nm, &there.motor_torque_nm];
            at.of("motor_torque_nm").all_near(here.as_slice(), there.as_slice(), meaning)?;
        }
        Ok(())
    }

    /// Checks that pose, contacts, forces and torques equal those of a sample moved by `moved`.
    fn copies(&self, sample: &Sample, moved: Placement, meaning: &str) -> Result<(), PlanError> {
        let Self { plan, state, at } = self;
        let near = |name: &str, found: &[f64], expected: &[f64]| {
            at.of(name).all_near(found, expected, meaning)
        };
        let [yaw, pitch, roll] = sample.base_yaw_pitch_roll_rad;
        let angles = [yaw + moved.yaw_rad, pitch, roll];
        near("base_position_m", &state.base_position_m, &moved.point(sample.base_position_m))?;
        near("base_yaw_pitch_roll_rad", &state.base_yaw_pitch_roll_rad, &angles)?;
        near("joint_rad", &state.joint_rad, &sample.joint_rad)?;
        near("com_m", &state.com_m, &moved.point(sample.com_m))?;
        self.has_contacts_of(sample, meaning)?;
        self.has_torques_of(sample, meaning)?;
        for ((at, here, there), foot) in self.feet(sample).zip(&plan.robot.end_effectors) {
            let (position_m, force_n) =
                (moved.point(there.position_m), moved.vector(there.force_n));
            let turn = if foot.contact.rolls() { moved.yaw_rad } else { 0.0 };
            at.of("position_m").all_near(&here.position_m, &position_m, meaning)?;
            at.of("force_n").all_near(&here.force_n, &force_n, meaning)?;
            at.of("tilt_rad").near(here.tilt_rad, there.tilt_rad, meaning)?;
            at.of("yaw_rad").near(here.yaw_rad, there.yaw_rad + turn, meaning)?;
        }
        Ok(())
    }

    /// Checks that all values, including speeds, equal those of a sample moved by `moved`.
    fn repeats(&self, sample: &Sample, moved: Placement, meaning: &str) -> Result<(), PlanError> {
        self.copies(sample, moved, meaning)?;
        // A motor speed takes a next state, which only the state before the motion has.
        let has_next = self.state.time_s < 0.0;
        for (at, here, there) in self.feet(sample) {
            let at_wheel = at.of("wheel_speed_rad_s");
            at_wheel.near(here.wheel_speed_rad_s, there.wheel_speed_rad_s, meaning)?;
            if has_next {
                let at_motor = at.of("motor_speed_rad_s");
                at_motor.near(here.motor_speed_rad_s, there.motor_speed_rad_s, meaning)?;
            }
        }
        Ok(())
    }

    /// Checks that centre of mass, contact points and wheel axes follow from base and joints. In samples, their differences are
    /// residuals; in a state of another motion, they are exact.
    fn is_pose_of(&self, model: &Model) -> Result<(), PlanError> {
        let meaning = "by forward kinematics";
        let Self { plan, state, at } = self;
        let mut q = DVector::zeros(model.dofs());
        q.rows_mut(BASE_POSITION, 3).copy_from_slice(&state.base_position_m);
        q.rows_mut(BASE_YAW, 3).copy_from_slice(&state.base_yaw_pitch_roll_rad);
        q.rows_mut(JOINTS, state.joint_rad.len()).copy_from_slice(&state.joint_rad);
        let pose = model.pose(&q);
        at.of("com_m").all_near(&state.com_m, pose.com.as_slice(), meaning)?;
        let feet = plan.robot.end_effectors.iter().zip(&state.end_effectors);
        for (j, ((foot, here), mount)) in feet.zip(&pose.end_effectors).enumerate() {
            let at = at.item("end_effectors", j);
            let mut to_contact = Vector3::new(0.0, 0.0, -foot.radius_m);
            if foot.contact.rolls() {
                // Eq. 2.2.
                let heading = yaw_rotation(here.yaw_rad);
                let (sin, cos) = here.tilt_rad.sin_cos();
                let axis = heading * Vector3::new(0.0, cos, sin);
                to_contact = axis.cross(&(heading * Vector3::x())) * foot.radius_m;
                let tilt_and_yaw = format!("{:?}", [here.tilt_rad, here.yaw_rad]);
                let expected = format!(
                    "tilt and yaw of the wheel axis {:?}, {meaning}",
                    mount.axis.as_slice()
                );
                let near = (axis - mount.axis).amax() <= AGREEMENT;
                at.of("(tilt_rad, yaw_rad)").holds(near, tilt_and_yaw, expected)?;
            }
            let contact = mount.center + to_contact;
            at.of("position_m").all_near(&here.position_m, contact.as_slice(), meaning)?;
        }
        Ok(())
    }
}
