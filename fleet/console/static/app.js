// The page: starts each of its parts once.

import { startAlerts } from "./alerts.js";
import { startAnswers } from "./answers.js";
import { startControl } from "./control.js";
import { startMap } from "./map.js";
import { startPad } from "./pad.js";
import { startPanel } from "./panel.js";
import { startPast } from "./past.js";
import { startRobots } from "./robots.js";
import { startSession } from "./session.js";
import { startStopView } from "./stopview.js";
import { start } from "./store.js";

startStopView();
startRobots();
startPanel();
startAnswers();
startMap();
startPad();
startControl();
startAlerts();
startPast();
startSession();
start();
