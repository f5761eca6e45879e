import "uplot/dist/uPlot.min.css";
import "./styles/page.css";

import { type ComponentType, render } from "preact";
import { useEffect, useState } from "preact/hooks";
import { car, isMeasured, model, vehicle } from "./state/car";
import { chooseLink, startPage } from "./state/catalogue";
import { keepLate } from "./state/answer";
import { keepWays } from "./state/charging";
import { keepDriving } from "./state/drive";
import { keepForecasting } from "./state/forecast";
import { keepReach } from "./state/journey";
import { isOpen as roadIsOpen, keepOnRoad, openFromAddress } from "./state/live-drive";
import { keepLink } from "./state/link";
import { keepAdvice } from "./state/advice";
import { keepNeed } from "./state/need";
import { isOpen as carsAreOpen, labelOf } from "./state/own-cars";
import { keepPosition } from "./state/position";
import { keepLanguage, keepPreferences, text } from "./state/preferences";
import { AdviceCard } from "./ui/advice";
import { Announcer } from "./ui/announcer";
import { Chips } from "./ui/chips";
import { ConditionsPanel } from "./ui/conditions-panel";
import { Details } from "./ui/details";
import { Glance } from "./ui/glance";
import { Header } from "./ui/header";
import { JourneyAnswer } from "./ui/journey-answer";
import { MapCard } from "./ui/map-card";
import { Result } from "./ui/result";
import { CarDialog } from "./ui/car-dialog";
import { connectTokenDialog, TokenDialog } from "./ui/token-dialog";
import { TripPanel } from "./ui/trip-panel";
import { VerdictCard } from "./ui/verdict";

function Foot() {
  const learned = model.value?.model;
  const { foot } = text.value;
  const { own, title = "" } = car.value ?? {};
  return (
    <footer>
      {own && (
        <p>
          {foot.ownCar(labelOf(own), title)} {foot.caution}
        </p>
      )}
      {!own && learned && (
        <p>
          {isMeasured.value
            ? `${learned.car_title}. ${foot.model(learned.trips)}`
            : `${foot.published(vehicle.value?.title ?? car.value?.title ?? "")} ${foot.modelOfCar(learned.trips, learned.car_title)}`}{" "}
          {foot.caution}
        </p>
      )}
      <p>
        <a href="openapi.json">{foot.openapi}</a> <a href="licences.txt">{foot.licences}</a>
      </p>
    </footer>
  );
}

const ownCars = () => import("./ui/own-cars-dialog").then(({ OwnCarsDialog }) => OwnCarsDialog);
const liveDrive = () => import("./ui/live-drive").then(({ LiveDrive }) => LiveDrive);

/** A dialog that is loaded when it is first opened. */
function Later({ isOpen, load }: { isOpen: boolean; load: () => Promise<ComponentType> }) {
  const [loaded, setLoaded] = useState<{ Dialog: ComponentType } | null>(null);
  useEffect(() => {
    if (isOpen) void load().then((Dialog) => setLoaded({ Dialog }));
  }, [isOpen]);
  return loaded && <loaded.Dialog />;
}

function Page() {
  return (
    <>
      <a class="skip" href="#content">
        {text.value.skip}
      </a>
      <Header />
      <main id="content">
        <div class="asked">
          <TripPanel />
          <ConditionsPanel />
        </div>
        <div class="answered">
          <Chips />
          <VerdictCard />
          <MapCard />
          <JourneyAnswer />
          <AdviceCard />
          <Result />
          <Details />
        </div>
      </main>
      <Foot />
      <Glance />
      <Announcer />
      <CarDialog />
      <Later isOpen={carsAreOpen.value} load={ownCars} />
      <Later isOpen={roadIsOpen.value} load={liveDrive} />
      <TokenDialog />
    </>
  );
}

connectTokenDialog();
await keepLanguage();
keepPreferences();
keepForecasting();
keepDriving();
keepOnRoad();
keepPosition();
keepReach();
keepNeed();
keepLate();
keepWays();
keepAdvice();
openFromAddress();
keepLink((linked) => void chooseLink(linked));
render(<Page />, document.body);
void startPage();
