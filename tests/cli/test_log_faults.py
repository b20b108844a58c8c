"""oted data check on logs with one fault each, planted in the logs of two robots: test_log_faults.py PATH/TO/oted"""

import json
import unittest

import log_robots
import program
from program import ProgramTest

ROBOTS = {name: log_robots.dataclasses.replace(log_robots.ROBOTS[name], episodes=4, rows=150) for name in ("ant", "arm")}
POSITIONS_TELL = ("sign", "swapped joints", "encoder offset", "degrees", "action sign", "swapped actions")


class LogFaults(ProgramTest):
    def warnings(self, robot, log):
        task = log_robots.write(robot, log, self.folder)
        record = json.loads(self.succeed("data", "check", task, "--json").stdout)
        return [f for f in record["findings"] if f["severity"] != "note"]

    def test_clean_logs_raise_no_warning(self):
        for name, robot in ROBOTS.items():
            with self.subTest(name):
                self.assertEqual(self.warnings(robot, log_robots.drive(robot)), [])

    def test_springs_and_a_servo_that_are_off_are_no_zeros(self):
        """They move where the joints stand, as a zero does."""
        robot = log_robots.dataclasses.replace(log_robots.ROBOTS["sprung finger"], episodes=3, positions_alone=True)

        def soften(model):
            model.jnt_stiffness[0] *= 1.67
            model.dof_damping[:] *= 1.75
            model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1] = 1100, -1100
            model.wrap_prm[1] = 0.0095

        log = log_robots.drive(robot, change=soften, noise=5e-4)
        self.assertNotIn("joint_zero", [f["check"] for f in self.warnings(robot, log)])

    def test_each_fault_is_found_in_its_channels(self):
        for name, robot in ROBOTS.items():
            clean = log_robots.drive(robot)
            for fault in filter(lambda fault: log_robots.is_there(fault, robot), log_robots.FAULTS):
                with self.subTest(robot=name, fault=fault):
                    log, (check, channels) = log_robots.plant(fault, robot, clean, log_robots.hinges_of(robot))
                    found = self.warnings(robot, log)
                    named = {channel for f in found if f["check"] == check for channel in f["channels"]}
                    self.assertIn(check, [f["check"] for f in found])
                    self.assertLessEqual(set(channels), named, found)

    def test_the_correction_that_is_named_is_the_right_one(self):
        robot = ROBOTS["ant"]
        clean = log_robots.drive(robot)
        a, b = log_robots.hinges_of(robot)
        for fault, check, remedy in (
                ("sign", "joint_sign", f"turn round the sign of joint/{a}/qpos and joint/{a}/qvel"),
                ("position sign", "joint_sign", f"turn round the sign of joint/{a}/qpos"),
                ("swapped joints", "swapped_joints", f"swap joint/{a}/qpos with joint/{b}/qpos"),
                ("encoder offset", "joint_zero", f"add -0.1 to joint/{b}/qpos")):
            with self.subTest(fault):
                log, _ = log_robots.plant(fault, robot, clean, (a, b))
                remedies = [f["remedy"] for f in self.warnings(robot, log) if f["check"] == check]
                self.assertEqual(len(remedies), 1)
                self.assertTrue(remedies[0].startswith(remedy), remedies)

    def test_a_fault_is_found_in_positions_alone(self):
        for name in ("arm", "finger", "cheetah"):
            robot = log_robots.dataclasses.replace(log_robots.ROBOTS[name], episodes=4)
            clean = log_robots.drive(robot, noise=1e-3)
            robot = log_robots.dataclasses.replace(robot, positions_alone=True)
            self.assertEqual(self.warnings(robot, clean), [])
            for fault in POSITIONS_TELL:
                with self.subTest(robot=name, fault=fault):
                    log, (check, channels) = log_robots.plant(fault, robot, clean, log_robots.hinges_of(robot))
                    found = self.warnings(robot, log)
                    found = [f for f in found if f["check"] != "large_turns"]  # of degrees, it says less
                    self.assertEqual([f["check"] for f in found], [check])
                    self.assertEqual(set(found[0]["channels"]), {c for c in channels if "/qvel" not in c})

    def test_a_fault_of_one_recording_is_named_with_it(self):
        """The three others are clean, so nothing is said of all."""
        for name, robot in ROBOTS.items():
            clean = log_robots.drive(robot)
            a, b = log_robots.hinges_of(robot)
            for fault, check, remedy in (
                    ("sign", "joint_sign", f"turn round the sign of joint/{a}/qpos and joint/{a}/qvel"),
                    ("encoder offset", "joint_zero", f"add -0.1 to joint/{b}/qpos")):
                with self.subTest(robot=name, fault=fault):
                    log, _ = log_robots.plant(fault, robot, clean, (a, b))
                    rows = clean.rows.copy()
                    rows[1] = log.rows[1]
                    found = self.warnings(robot, log_robots.dataclasses.replace(clean, rows=rows))
                    remedies = [f["remedy"] for f in found if f["check"] == check]
                    self.assertEqual(len(remedies), 1, found)
                    self.assertTrue(remedies[0].startswith(f"in episode 2 alone: {remedy}"), remedies)
                    self.assertLessEqual({f["check"] for f in found}, {check, "one_step_error"})

    def test_actions_of_one_recording_that_are_late_are_named_with_it(self):
        for name, robot in ROBOTS.items():
            clean = log_robots.drive(robot)
            log, _ = log_robots.plant("actions a row late", robot, clean, log_robots.hinges_of(robot))
            commands = clean.commands.copy()
            commands[2] = log.commands[2]
            warnings = self.warnings(robot, log_robots.dataclasses.replace(clean, commands=commands))
            found = {f["check"]: f["remedy"] for f in warnings}
            with self.subTest(name):
                self.assertEqual(found.get("shifted_actions"),
                                 "in episode 3 alone: shift the actions by this number of rows")
                self.assertLessEqual(set(found), {"shifted_actions", "measurement_noise"})

    def test_degrees_of_one_recording_are_named_with_it(self):
        for name, robot in ROBOTS.items():
            clean = log_robots.drive(robot)
            a, b = log_robots.hinges_of(robot)
            log, _ = log_robots.plant("degrees", robot, clean, (a, b))
            rows = clean.rows.copy()
            rows[1] = log.rows[1]
            found = {f["check"]: f["remedy"] for f in self.warnings(robot, log_robots.dataclasses.replace(clean, rows=rows))}
            with self.subTest(name):
                self.assertEqual(found.get("joint_unit"), f"in episode 2 alone: multiply joint/{a}/qpos and joint/{a}/qvel "
                                 "by 0.0174533", found)

    def test_a_recording_whose_joints_are_all_in_degrees_is_named(self):
        robot = ROBOTS["arm"]
        clean = log_robots.drive(robot)
        rows = clean.rows.copy()
        rows[1] *= 180 / log_robots.np.pi
        found = self.warnings(robot, log_robots.dataclasses.replace(clean, rows=rows))
        of_unit = [f for f in found if f["check"] == "joint_unit"]
        self.assertEqual([set(f["channels"]) for f in of_unit], [set(clean.names)])
        self.assertRegex(of_unit[0]["remedy"], "^in episode 2 alone: multiply .* by 0.0174533$")

    def test_thousandths_are_named_by_their_column(self):
        for name, robot in ROBOTS.items():
            log = log_robots.drive(robot)
            channel = "joint/root/qpos[2]" if name == "ant" else f"joint/{log_robots.hinges_of(robot)[0]}/qpos"
            log.rows[:, :, log.at(channel)] *= 1000
            with self.subTest(robot=name):
                found = {f["check"]: f["remedy"] for f in self.warnings(robot, log)}
                self.assertEqual(found.get("rate_unit"), f"multiply {channel} by 0.001", found)
                self.assertLessEqual(set(found), {"rate_unit", "joint_unit", "one_step_error"})
                # The simulator says the same, where it is asked at all.
                self.assertTrue(found.get("joint_unit", found["rate_unit"]).startswith(found["rate_unit"]), found)

    def test_quaternions_whose_signs_change_are_named_and_nothing_else(self):
        robot = ROBOTS["ant"]
        log = log_robots.drive(robot)
        quaternion = log.at(*(f"joint/root/qpos[{k}]" for k in range(3, 7)))
        signs = log_robots.np.where(log_robots.np.random.default_rng(0).random(log.rows.shape[:2]) < 0.1, -1, 1)
        log.rows[:, :, quaternion] *= signs.cumprod(axis=1)[:, :, None]
        self.assertEqual([f["check"] for f in self.warnings(robot, log)], ["quaternion_sign"])


if __name__ == "__main__":
    program.take_paths(__doc__)
    unittest.main()
