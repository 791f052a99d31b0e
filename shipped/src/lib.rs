//! Robots, motions, designs and gamepad mappings that ship with rollwalk.
//!
//! The texts are embedded in the programs, so that `rollwalk demo` runs in any folder and the studio opens without a server.
//!
//! ```
//! let robots = rollwalk_shipped::FILES.iter().filter(|(path, _)| path.starts_with("robots/"));
//! assert!(robots.clone().any(|(path, text)| *path == "robots/agilebot.toml" && text.contains("name")));
//! ```

/// Declares the shipped files by their folder (relative to this crate) and the path under which they ship.
macro_rules! shipped {
    ($($folder:literal: $($path:literal),* $(,)?);* $(;)?) => {
        /// Path and text of each shipped file.
        pub const FILES: &[(&str, &str)] =
            &[$($(($path, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/", $folder, $path)))),*),*];
    };
}

// Mappings of gamepads are beside the crate that reads them.
shipped!(
    "../host/": "gamepads/xbox.toml", "gamepads/playstation.toml";
    "":
    "designs/agilebot_dataset_sweep.toml",
    "designs/agilebot_fast_trot.toml",
    "designs/agilebot_legs.toml",
    "designs/agilebot_legs_sweep.toml",
    "designs/car_tilted.toml",
    "designs/table_3_2_sweep.toml",
    "motions/agilebot_library.toml",
    "motions/agilebot_skills_library.toml",
    "motions/anymal_drive.toml",
    "motions/anymal_duck.toml",
    "motions/anymal_floor_library.toml",
    "motions/anymal_library.toml",
    "motions/anymal_lie.toml",
    "motions/anymal_stand.toml",
    "motions/anymal_stand_up.toml",
    "motions/anymal_turn.toml",
    "motions/anymal_walk.toml",
    "motions/car_drive.toml",
    "motions/drive_1m.toml",
    "motions/duck.toml",
    "motions/flying_trot.toml",
    "motions/legbot_walk.toml",
    "motions/pace.toml",
    "motions/pronk.toml",
    "motions/pup_belt_walk.toml",
    "motions/pup_drive.toml",
    "motions/pup_five_bar_walk.toml",
    "motions/pup_library.toml",
    "motions/pup_linear_walk.toml",
    "motions/pup_stand.toml",
    "motions/pup_toes_walk.toml",
    "motions/pup_walk.toml",
    "motions/roll.toml",
    "motions/skate.toml",
    "motions/skaterbot_library.toml",
    "motions/skaterbot_stand.toml",
    "motions/slalom.toml",
    "motions/stand.toml",
    "motions/stand_up.toml",
    "motions/step_and_drive.toml",
    "motions/swizzlebot2_forward.toml",
    "motions/swizzlebot3_forward.toml",
    "motions/swizzlebot4_forward.toml",
    "motions/swizzlebot5_forward.toml",
    "motions/swizzlebot_forward.toml",
    "motions/swizzlebot_library.toml",
    "motions/swizzlebot_stand.toml",
    "motions/swizzlebot_turn.toml",
    "motions/table_2_1/agilebot_side_step_and_roll.toml",
    "motions/table_2_1/agilebot_start_stop.toml",
    "motions/table_2_1/agilebot_turn.toml",
    "motions/table_2_1/brainbot_forward.toml",
    "motions/table_2_1/brainbot_turn.toml",
    "motions/table_2_1/creature3_fast_walk.toml",
    "motions/table_2_1/creature3_turn.toml",
    "motions/table_2_1/creature3_walk.toml",
    "motions/table_2_1/dinobot_skating.toml",
    "motions/table_2_1/skatebot_skating.toml",
    "motions/table_2_1/swizzlebot_forward.toml",
    "motions/table_2_1/swizzlebot_turn.toml",
    "motions/test_leg_library.toml",
    "motions/test_leg_roll.toml",
    "motions/test_leg_stand.toml",
    "motions/trot.toml",
    "motions/turn_in_place.toml",
    "motions/walk.toml",
    "motions/walk_and_roll.toml",
    "motions/walk_held.toml",
    "robots/agilebot.toml",
    "robots/agilebot_sprint.toml",
    "robots/anymal_wheels.toml",
    "robots/brainbot.toml",
    "robots/car.toml",
    "robots/car_tilted.toml",
    "robots/creature3.toml",
    "robots/dinobot.toml",
    "robots/legbot.toml",
    "robots/pup.toml",
    "robots/pup_belt.toml",
    "robots/pup_five_bar.toml",
    "robots/pup_linear.toml",
    "robots/pup_toes.toml",
    "robots/skatebot.toml",
    "robots/skaterbot.toml",
    "robots/swizzlebot.toml",
    "robots/swizzlebot2.toml",
    "robots/swizzlebot4.toml",
    "robots/swizzlebot5.toml",
    "robots/test_leg.toml",
);

/// Text of a shipped file, by its path: `robots/agilebot.toml`.
pub fn text(path: &str) -> Option<&'static str> {
    let path = path.strip_prefix("./").unwrap_or(path);
    FILES.iter().find(|(shipped, _)| *shipped == path).map(|(_, text)| *text)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    /// Checks that every file in the folders of the checkout ships.
    #[test]
    fn no_robot_and_no_motion_is_left_out() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut found = 0;
        for (folder, place) in [
            ("robots", "robots"),
            ("motions", "motions"),
            ("motions/table_2_1", "motions/table_2_1"),
            ("designs", "designs"),
            ("gamepads", "../host/gamepads"),
        ] {
            for entry in fs::read_dir(root.join(place)).unwrap() {
                let name = entry.unwrap().file_name().into_string().unwrap();
                if name.ends_with(".toml") && name != "Cargo.toml" {
                    let path = format!("{folder}/{name}");
                    assert!(super::text(&path).is_some(), "{path} is not shipped");
                    found += 1;
                }
            }
        }
        assert!(found > 60, "{found} files");
    }
}
