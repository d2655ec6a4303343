"""Loads an exported file with the parser of the program that it is for, and prints its numbers as JSON."""
import json
import sys
import xml.etree.ElementTree as ElementTree

format, path = sys.argv[1:]


def opencv(keys, parent=None):
    import cv2

    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_READ)
    assert storage.isOpened(), path
    root = storage.getNode(parent) if parent else storage.root()
    numbers = {}
    for key in keys:
        node = root.getNode(key)
        assert node.isReal() or node.isInt(), key
        numbers[key] = node.real()
    return numbers


KALIBR = [
    sensor + "_" + what
    for sensor in ("gyroscope", "accelerometer")
    for what in ("noise_density", "random_walk")
] + ["update_rate"]

if format == "kalibr":
    import yaml

    with open(path) as file:
        numbers = {key: value for key, value in yaml.safe_load(file).items() if key != "rostopic"}
elif format == "openvins":
    numbers = opencv(KALIBR, "imu0")
elif format == "vins":
    numbers = opencv(["acc_n", "gyr_n", "acc_w", "gyr_w"])
elif format == "orbslam3":
    numbers = opencv(["IMU.NoiseGyro", "IMU.NoiseAcc", "IMU.GyroWalk", "IMU.AccWalk", "IMU.Frequency"])
elif format == "kf-gins":
    import yaml

    with open(path) as file:
        numbers = yaml.safe_load(file)["imunoise"]
elif format == "gtsam":
    import runpy

    params = runpy.run_path(path)["preintegration_params"]()
    numbers = {
        name: [float(getattr(params, "get" + name)()[axis, axis]) for axis in range(3)]
        for name in ("AccelerometerCovariance", "GyroscopeCovariance", "BiasAccCovariance", "BiasOmegaCovariance")
    }
elif format == "gazebo":
    imu = ElementTree.parse(path).getroot().find("model/link/sensor")
    numbers = {"update_rate": float(imu.find("update_rate").text)}
    for sensor in ("angular_velocity", "linear_acceleration"):
        for element in ("stddev", "dynamic_bias_stddev", "dynamic_bias_correlation_time"):
            nodes = [imu.find(f"imu/{sensor}/{axis}/noise/{element}") for axis in "xyz"]
            numbers[sensor + "/" + element] = [float(node.text) for node in nodes]
else:
    sys.exit("no loader for " + format)

json.dump(numbers, sys.stdout)
