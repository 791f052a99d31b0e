//! Tests of kinematics and dynamics: closed forms, finite differences, a second algorithm, MuJoCo.

mod closed_forms;
mod contacts;
mod distances;
mod dynamics;
mod euler;
mod jacobians;
mod mjcf;
mod mujoco;
mod passive;
mod robots;
mod standing;
